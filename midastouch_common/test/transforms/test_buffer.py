"""TransformBuffer against SciPy and against the rules of tf2."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from midastouch_common import se3
from midastouch_common.message_arrays import SECOND
from midastouch_common.transforms import (
    DisconnectedError,
    FutureExtrapolationError,
    Insertion,
    InvalidTransformError,
    PastExtrapolationError,
    TransformBuffer,
    UnknownFrameError,
)

IDENTITY = np.eye(4)


def random_transforms(n, seed):
    rng = np.random.default_rng(seed)
    return se3.make(se3.random_rotations(n, rng), rng.uniform(-1, 1, (n, 3)))


def moving(buffer, parent, child, transforms, step_ns=100_000_000, start_ns=SECOND):
    for i, transform in enumerate(transforms):
        buffer.insert(parent, child, start_ns + i * step_ns, transform)


@given(seed=st.integers(0, 2**32 - 1), fraction=st.floats(0, 1))
@settings(deadline=None, max_examples=50)
def test_one_edge_is_lerp_and_slerp(seed, fraction):
    start, end = random_transforms(2, seed)
    buffer = TransformBuffer()
    moving(buffer, "base", "gel", [start, end], step_ns=SECOND)
    got = buffer.lookup("base", "gel", SECOND + round(fraction * SECOND))
    exact = round(fraction * SECOND) / SECOND
    rotation = Slerp([0, 1], Rotation.from_matrix([start[:3, :3], end[:3, :3]]))(exact).as_matrix()
    np.testing.assert_allclose(got[:3, :3], rotation, atol=1e-9)
    np.testing.assert_allclose(got[:3, 3], (1 - exact) * start[:3, 3] + exact * end[:3, 3], atol=1e-12)
    np.testing.assert_array_equal(got[3], [0, 0, 0, 1])


@given(seed=st.integers(0, 2**32 - 1), fraction=st.floats(0, 1), angle=st.floats(1e-12, 1e-3))
@settings(deadline=None, max_examples=30)
def test_tiny_rotations_keep_their_accuracy(seed, fraction, angle):
    start = random_transforms(1, seed)[0]
    end = start @ se3.exp(np.array([0, 0, 0, angle, 0, 0]))
    buffer = TransformBuffer()
    moving(buffer, "base", "gel", [start, end], step_ns=SECOND)
    got = buffer.lookup("base", "gel", SECOND + round(fraction * SECOND))
    turned = se3.log(se3.inverse(start) @ got)[3:]
    np.testing.assert_allclose(turned, [fraction * angle, 0, 0], atol=1e-9 * angle + 3e-15)


@given(seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=30)
def test_chain_is_the_product_of_its_edges_and_inverts(seed):
    base_tool, tool_link, link_gel, base_camera = random_transforms(4, seed)
    buffer = TransformBuffer()
    buffer.insert("base", "tool", SECOND, base_tool)
    buffer.insert("tool", "link", 0, tool_link, static=True)
    buffer.insert("link", "gel", SECOND, link_gel)
    buffer.insert("base", "camera", SECOND, base_camera)
    expected = se3.inverse(base_camera) @ base_tool @ tool_link @ link_gel
    np.testing.assert_allclose(buffer.lookup("camera", "gel", SECOND), expected, atol=1e-12)
    np.testing.assert_allclose(buffer.lookup("gel", "camera", SECOND), se3.inverse(expected), atol=1e-12)
    np.testing.assert_allclose(buffer.lookup("gel", "gel", SECOND), IDENTITY, atol=1e-15)


def test_each_edge_is_interpolated_by_itself_as_in_tf2():
    """Half a turn of a lever: the tip follows the arc, it does not cut the chord between its end points."""
    quarter = se3.exp(np.array([0, 0, 0, 0, 0, np.pi / 2]))
    lever = se3.translation([0.1, 0, 0])
    buffer = TransformBuffer()
    moving(buffer, "base", "tool", [IDENTITY, quarter], step_ns=SECOND)
    buffer.insert("tool", "gel", 0, lever, static=True)
    tip = buffer.lookup("base", "gel", SECOND + SECOND // 2)[:3, 3]
    np.testing.assert_allclose(np.linalg.norm(tip), 0.1, atol=1e-12)


def test_both_signs_of_a_quaternion_interpolate_alike():
    row = np.array([0, 0, 0, 0, 0, np.sin(0.2), np.cos(0.2)])
    flipped = row * [1, 1, 1, -1, -1, -1, -1]
    for second in (row, flipped):
        buffer = TransformBuffer()
        moving(buffer, "base", "gel", [np.array([0, 0, 0, 0, 0, 0, 1.0]), second], step_ns=SECOND)
        half = se3.log(buffer.lookup("base", "gel", SECOND + SECOND // 2))
        np.testing.assert_allclose(half, [0, 0, 0, 0, 0, 0.2], atol=1e-12)


def test_static_transform_holds_at_every_stamp_and_is_replaced():
    buffer = TransformBuffer()
    first, second = random_transforms(2, 3)
    buffer.insert("link", "gel", 5 * SECOND, first, static=True)
    for stamp in (0, 5 * SECOND, 10**18):
        np.testing.assert_allclose(buffer.lookup("link", "gel", stamp), first, atol=1e-12)
    buffer.insert("link", "gel", 0, second, static=True)
    np.testing.assert_allclose(buffer.lookup("link", "gel", SECOND), second, atol=1e-12)


def test_unknown_frame_and_disconnected_trees_are_distinguished():
    buffer = TransformBuffer()
    moving(buffer, "base", "gel", [IDENTITY, IDENTITY])
    moving(buffer, "world", "object", [IDENTITY, IDENTITY])
    with pytest.raises(UnknownFrameError, match="'tool0'"):
        buffer.lookup("base", "tool0", SECOND)
    with pytest.raises(DisconnectedError, match="root 'world'"):
        buffer.lookup("object", "gel", SECOND)


def test_outside_the_history_says_past_or_future():
    buffer = TransformBuffer()
    moving(buffer, "base", "gel", [IDENTITY, IDENTITY])
    with pytest.raises(PastExtrapolationError, match=r"starts at 1\.000000"):
        buffer.lookup("base", "gel", SECOND - 1)
    with pytest.raises(FutureExtrapolationError, match=r"newest is of 1\.100000"):
        buffer.lookup("base", "gel", SECOND + 100_000_001)
    moving(buffer, "gel", "tip", [IDENTITY], start_ns=3 * SECOND)
    with pytest.raises(PastExtrapolationError):  # one edge too early, the other too late: waiting is in vain
        buffer.lookup("base", "tip", 2 * SECOND)


def test_duplicates_keep_the_first_and_late_ones_are_sorted_in():
    buffer = TransformBuffer()
    early, middle, late = random_transforms(3, 7)
    assert buffer.insert("base", "gel", SECOND, early) is Insertion.ADDED
    assert buffer.insert("base", "gel", 3 * SECOND // 2, late) is Insertion.ADDED
    assert buffer.insert("base", "gel", SECOND, late) is Insertion.DUPLICATE
    assert buffer.insert("base", "gel", 5 * SECOND // 4, middle) is Insertion.ADDED
    np.testing.assert_allclose(buffer.lookup("base", "gel", SECOND), early, atol=1e-12)
    np.testing.assert_allclose(buffer.lookup("base", "gel", 5 * SECOND // 4), middle, atol=1e-12)


def test_backward_jump_of_time_begins_the_history_of_that_edge_anew():
    buffer = TransformBuffer()
    mount = random_transforms(1, 1)[0]
    moving(buffer, "base", "gel", [IDENTITY] * 30)
    moving(buffer, "base", "other", [IDENTITY] * 30)
    newest = buffer.latest_common_stamp("base", "other")
    assert buffer.insert("base", "gel", SECOND, mount) is Insertion.TIME_JUMP
    np.testing.assert_allclose(buffer.lookup("base", "gel", SECOND), mount, atol=1e-12)
    with pytest.raises(FutureExtrapolationError):
        buffer.lookup("base", "gel", newest)
    np.testing.assert_array_equal(buffer.lookup("base", "other", newest), IDENTITY)


def test_clearing_keeps_what_is_static():
    buffer = TransformBuffer()
    mount = random_transforms(1, 1)[0]
    buffer.insert("gel", "camera", 0, mount, static=True)
    moving(buffer, "base", "gel", [IDENTITY] * 30)
    buffer.clear()
    np.testing.assert_allclose(buffer.lookup("gel", "camera", SECOND), mount, atol=1e-12)
    with pytest.raises(UnknownFrameError):
        buffer.lookup("base", "gel", SECOND)


MS = 1_000_000
# transforms in time, late, repeated, after a gap, and from clocks that step forwards and backwards
steps_ms = st.lists(
    st.one_of(st.integers(1, 100), st.integers(-900, 0), st.integers(-20_000, 20_000)), min_size=1, max_size=40
)


@given(steps_ms, st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=100)
def test_any_order_of_stamps_answers_as_a_sorted_history(steps, seed):
    """Against a plain model: the first of equal stamps counts, 10 s are kept, 1 s back is a jump."""
    rng = np.random.default_rng(seed)
    buffer, known, stamp = TransformBuffer(history_s=10.0, jump_s=1.0), {}, 1_000_000 * MS
    for step, transform in zip(steps, random_transforms(len(steps), seed), strict=True):
        stamp = max(known, default=stamp) + step * MS
        jumped = bool(known) and stamp < max(known) - 1000 * MS
        if jumped:
            known.clear()
        expected = Insertion.TIME_JUMP if jumped else Insertion.DUPLICATE if stamp in known else Insertion.ADDED
        assert buffer.insert("base", "gel", stamp, transform) is expected
        known.setdefault(stamp, transform)
        known = {t: known[t] for t in sorted(known) if t >= max(known) - 10_000 * MS}
        stamps = list(known)
        asked = int(rng.integers(stamps[0] - 5 * MS, stamps[-1] + 5 * MS))
        if asked < stamps[0]:
            with pytest.raises(PastExtrapolationError):
                buffer.lookup("base", "gel", asked)
        elif asked > stamps[-1]:
            with pytest.raises(FutureExtrapolationError):
                buffer.lookup("base", "gel", asked)
        else:
            got = buffer.lookup("base", "gel", asked)
            after = next(i for i, t in enumerate(stamps) if t >= asked)
            start, end = known[stamps[max(after - 1, 0)]], known[stamps[after]]
            span = stamps[after] - stamps[max(after - 1, 0)]
            fraction = (asked - stamps[after - 1]) / span if span else 1.0
            rotation = Slerp([0, 1], Rotation.from_matrix([start[:3, :3], end[:3, :3]]))(fraction).as_matrix()
            np.testing.assert_allclose(got[:3, :3], rotation, atol=1e-8)
            np.testing.assert_allclose(got[:3, 3], (1 - fraction) * start[:3, 3] + fraction * end[:3, 3], atol=1e-9)


def test_latest_common_stamp_is_that_of_the_slowest_edge():
    buffer = TransformBuffer()
    moving(buffer, "base", "tool", [IDENTITY] * 5)
    moving(buffer, "tool", "gel", [IDENTITY] * 3)
    buffer.insert("gel", "camera", 0, IDENTITY, static=True)
    stamp = buffer.latest_common_stamp("base", "camera")
    assert stamp == SECOND + 200_000_000
    buffer.lookup("base", "camera", stamp)
    assert buffer.latest_common_stamp("gel", "camera") is None


def test_a_new_parent_starts_a_new_history():
    buffer = TransformBuffer()
    moving(buffer, "base", "gel", [IDENTITY] * 3)
    buffer.insert("tool", "gel", 2 * SECOND, IDENTITY)
    buffer.lookup("tool", "gel", 2 * SECOND)
    with pytest.raises(UnknownFrameError):
        buffer.lookup("base", "gel", SECOND)


def test_leading_slashes_name_the_same_frame():
    buffer = TransformBuffer()
    buffer.insert("/base", "gel", SECOND, IDENTITY)
    np.testing.assert_allclose(buffer.lookup("base", "/gel", SECOND), IDENTITY)


@pytest.mark.parametrize(
    ("transform", "reason"),
    [
        (np.array([0, 0, 0, 0, 0, 0, 0.0]), "zero"),
        (np.array([0, 0, 0, 0, 0, 0, 1.1]), "not a unit quaternion"),
        (np.array([np.nan, 0, 0, 0, 0, 0, 1]), "NaN"),
        (np.array([0, 0, 0, 0, 0, np.inf, 1]), "NaN or infinite"),
        (np.diag([1.0, 1, -1, 1]), "not rigid"),
        (np.diag([2.0, 2, 2, 1]), "not rigid"),
        (np.full((4, 4), np.nan), "NaN"),
        (np.ones((4, 4)), "not rigid"),
        (np.zeros(6), "shape"),
    ],
)
def test_what_is_not_a_transform_is_refused_with_a_reason(transform, reason):
    buffer = TransformBuffer()
    with pytest.raises(InvalidTransformError, match=reason):
        buffer.insert("base", "gel", SECOND, transform)
    with pytest.raises(UnknownFrameError):
        buffer.lookup("base", "gel", SECOND)


def test_almost_unit_quaternions_are_normalised():
    buffer = TransformBuffer()
    buffer.insert("base", "gel", SECOND, np.array([0, 0, 0, 0, 0, 0.6, 0.801]))
    rotation = buffer.lookup("base", "gel", SECOND)[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)


@pytest.mark.parametrize(("parent", "child"), [("gel", "gel"), ("", "gel"), ("base", ""), ("base", "/base")])
def test_frame_names_must_be_two_different_ones(parent, child):
    with pytest.raises(InvalidTransformError, match="frame names"):
        TransformBuffer().insert(parent, child, SECOND, IDENTITY)


def test_a_loop_is_refused_and_the_tree_stays_usable():
    buffer = TransformBuffer()
    buffer.insert("base", "tool", SECOND, IDENTITY)
    buffer.insert("tool", "gel", SECOND, IDENTITY)
    with pytest.raises(InvalidTransformError, match=r"'base'.*'gel'"):
        buffer.insert("gel", "base", SECOND, IDENTITY)
    np.testing.assert_allclose(buffer.lookup("base", "gel", SECOND), IDENTITY)


def test_filling_and_asking_from_two_threads():
    buffer = TransformBuffer(history_s=0.5)
    buffer.insert("base", "gel", SECOND, IDENTITY)
    failures = []

    def ask():
        for _ in range(2000):
            try:
                buffer.lookup("base", "gel", buffer.latest_common_stamp("base", "gel"))
            except PastExtrapolationError:
                pass  # the writer may have outrun this reader's history between the two calls
            except Exception as error:
                failures.append(error)

    reader = threading.Thread(target=ask)
    reader.start()
    moving(buffer, "base", "gel", [IDENTITY] * 5000, step_ns=1_000_000)
    reader.join()
    assert not failures
