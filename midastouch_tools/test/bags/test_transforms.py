"""Transforms that are late, twice or of another clock."""

import numpy as np
import pytest
from recorded import MOVED, MS, SECOND, STILL, image, tf, write

from midastouch_common.errors import InputError
from midastouch_common.frames import BASE_FRAME
from midastouch_common.transforms.rigid import TransformError
from midastouch_tools.bags.images import read_bag
from midastouch_tools.bags.transforms import RecordedTransforms


def test_a_chain_with_a_static_mount(tmp_path):
    path = write(
        tmp_path / "x.mcap",
        tf(SECOND, MOVED, child="tool0"),
        tf(0, [0, 0, 0.1, 0, 0, 0, 1], parent="tool0", recorded_ns=SECOND, topic="/tf_static"),
        image(SECOND),
    )
    (frame,) = read_bag(path)
    np.testing.assert_allclose(frame.base_from_gel[:3, 3], [0.1, 0, 0.1], atol=1e-12)


def test_odd_clocks_and_values_of_other_frames_do_no_harm(tmp_path):
    odd = [tf(stamp, STILL, child="tracker", recorded_ns=SECOND + i) for i, stamp in enumerate([9 * SECOND, 0, SECOND])]
    above = [
        tf(stamp, STILL, parent="map", child=BASE_FRAME, recorded_ns=SECOND + i)
        for i, stamp in enumerate([9 * SECOND, SECOND])
    ]
    broken = [tf(SECOND, [0, 0, 0, 0, 0, 0, 0], child="hand"), tf(SECOND + 1, [np.nan, 0, 0, 0, 0, 0, 1])]
    path = write(tmp_path / "x.mcap", *odd, *above, *broken, tf(SECOND, STILL), tf(2 * SECOND, MOVED), image(SECOND))
    (frame,) = read_bag(path)
    np.testing.assert_allclose(frame.base_from_gel, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("back_ms", [1200, 4900])
def test_a_clock_set_back_is_no_late_transform_and_is_refused(tmp_path, back_ms):
    stamps = [*range(0, 5000, 100), *range(5000 - back_ms, 9000, 100)]
    path = write(tmp_path / "x.mcap", *moving(stamps), image(1000 * MS, recorded_ns=30_000 * MS))
    with pytest.raises(InputError, match=f"{1e-3 * (5000 - back_ms):.3f} s; split the bag"):
        list(read_bag(path))


def moving(stamps_ms, wrong=()):
    """Transforms along x, 1 mm a millisecond, recorded in this order; those of the positions in `wrong` lie."""
    rows = [[9.0 if i in wrong else 1e-3 * s, 0, 0, 0, 0, 0, 1] for i, s in enumerate(stamps_ms)]
    return [
        tf(s * MS, row, recorded_ns=(20_000 + i) * MS) for i, (s, row) in enumerate(zip(stamps_ms, rows, strict=True))
    ]


@pytest.mark.parametrize(
    ("stamps_ms", "wrong", "left_out"),
    [
        ([*range(0, 5000, 100)], (), 0),
        ([0, 100, 100, 200, 200, 300, 3000], (), 0),  # twice the same
        ([0, 100, 100, 200, 200, 300, 3000], (2, 4), 2),  # two nodes publish the same frame
        ([0, 200, 100, 400, 300, 2000, 1100, 3000], (), 0),
        ([*range(0, 3900, 100), 1900, *range(3900, 5000, 100)], (39,), 1),  # 1.9 s late, and there already
        ([*range(0, 3900, 100), 1900, 2000, 2100, *range(3900, 5000, 100)], (39, 40, 41), 3),
        ([*range(0, 3900, 100), 1950, *range(3900, 5000, 100)], (39,), 1),  # later than anybody waits
        ([s for i in range(40) for s in (100 * i + 3000, 100 * i)], range(1, 80, 2), 40),  # another clock
    ],
)
def test_late_or_double_transforms_are_sorted_in_or_left_out(tmp_path, capsys, stamps_ms, wrong, left_out):
    asked = [s for i, s in enumerate(stamps_ms) if i not in wrong]
    images = [image(s * MS, recorded_ns=30_000 * MS) for s in asked]
    path = write(tmp_path / "x.mcap", *moving(stamps_ms, wrong), *images)
    frames = list(read_bag(path))
    assert [frame.stamp_ns for frame in frames] == [s * MS for s in asked]
    np.testing.assert_allclose([f.base_from_gel[0, 3] for f in frames], 1e-3 * np.array(asked), atol=1e-9)
    told = capsys.readouterr().err
    assert told.count("\n") == bool(left_out)
    assert told.startswith(f"{path}: {left_out} transform" if left_out else "")


def test_a_recording_refuses_what_it_does_not_give():
    recorded = RecordedTransforms()
    assert recorded.insert("base", "tool", SECOND, STILL)
    assert not recorded.insert("base", "tool", SECOND, MOVED), "the first of equal stamps counts"
    recorded.insert("map", "camera", SECOND, STILL)
    np.testing.assert_array_equal(recorded.lookup("/base", "tool", SECOND), np.eye(4))
    for source, stamp, reason in (
        ("tool", SECOND - 1, "recorded from 1.0"),
        ("tool", SECOND + 1, "recorded from 1.0"),
        ("camera", SECOND, "no chain"),
        ("cup", SECOND, "'cup' is not known"),
    ):
        with pytest.raises(TransformError, match=reason):
            recorded.lookup("base", source, stamp)
    with pytest.raises(TransformError, match="closes a loop"):
        recorded.insert("tool", "base", SECOND, STILL)
    recorded.insert("map", "tool", 2 * SECOND, STILL)
    with pytest.raises(TransformError):
        recorded.lookup("map", "tool", SECOND)
