"""What alignment sees of a pose is what the renderer sees of it."""

from __future__ import annotations

import numpy as np
import pytest

import midastouch_kernels as kernels

from .sheet import FOCAL, GEL_DISTANCE, HEIGHT, WIDTH, poses_above

MARGIN = 1e-3  # m
PLACED = 1e-16 * np.eye(6)  # a prior so narrow that the pose stays where it is

INFORMATION = 1e6  # of a pixel, 1 / m^2
NARROWEST = 3e-4  # m, residual at which half of a pixel is explained in the end
NOTHING = np.zeros((6, 6))
JITTER = np.diag(np.repeat([3e-4, 5e-3], 3) ** 2)
WIDE = np.diag(np.repeat([1.5e-3, 0.05], 3) ** 2)
FLOOR = 0.02
MANY, NEAR = 200, 50


class Hypotheses:
    """One frame's maps, taken at `truth`, and poses around it, the first ones nearest.

    Calls `MapAlignment.align_each` with what differs between tests.
    """

    def __init__(self, corners: np.ndarray):
        v, u = np.meshgrid(np.arange(HEIGHT), np.arange(WIDTH), indexing="ij")
        tangents = (u - (WIDTH - 1) / 2) / FOCAL, ((HEIGHT - 1) / 2 - v) / FOCAL
        depth = np.full((HEIGHT, WIDTH), GEL_DISTANCE)
        self._scene = kernels.Scene(
            kernels.TriangleGrid(corners, 2e-3), (depth + MARGIN).astype(np.float32), FOCAL, GEL_DISTANCE, MARGIN
        )
        self.alignment = kernels.MapAlignment(self._scene, *tangents, depth, INFORMATION, 22.5)
        self.truth = poses_above(1)[0]
        self.truth[2, 3] = -0.5e-3
        self.maps = self.rendered(self.truth)
        rng = np.random.default_rng(1)
        reach = np.linspace(0.1, 4.0, MANY)[:, None]
        self.poses = self.truth @ kernels.exponentials(reach * rng.normal(0, np.sqrt(np.diag(WIDE)), (MANY, 6)))
        roots = rng.normal(0, 0.3, (MANY, 6, 6)) * np.sqrt(np.diag(WIDE))[:, None]
        self.covariances = WIDE + roots @ roots.transpose(0, 2, 1)

    def rendered(self, *poses: np.ndarray) -> np.ndarray:
        """Maps (F, H, W) measured at some poses."""
        maps = np.zeros((len(poses), HEIGHT, WIDTH), np.float32)
        kernels.render(self._scene, np.stack(poses), maps, np.empty((len(poses), 0, 0), np.int32))
        return np.maximum(maps - np.float32(MARGIN), 0)

    def aligned(self, index=slice(None), **changed) -> list[np.ndarray]:
        """Poses, covariances, fits, poses and covariances seen, descents."""
        maps = changed.get("maps", self.maps)
        given = {
            "poses": self.poses[index],
            "covariances": self.covariances[index],
            "maps": maps,
            "gels": np.tile(np.eye(4), (len(maps), 1, 1)),
            "jitter": JITTER,
            "finger_error": NOTHING,
            "needed": np.zeros(len(self.poses[index])),
            "descents": 4,
            "seeds": False,
            "explains": 0.6,
            "patches": 1.0,
            "floor": FLOOR,
        }
        return list(self.alignment.align_each(**given | changed))

    def align(self, k: int, jitter: np.ndarray) -> tuple:
        """Hypothesis k by itself: pose, covariance and fit, jitter included."""
        return self.alignment.align(self.poses[k], self.covariances[k] + jitter, self.maps[0], self.poses[k])


@pytest.fixture(scope="module")
def hypotheses(corners):
    return Hypotheses(corners)


# a wall that goes through the camera's near plane
WALL = np.array([[[0.004, -0.02, -0.005], [0.004, 0.02, -0.005], [0.004, 0.0, 0.05]]])


@pytest.mark.parametrize("walled", [False, True])
def test_alignment_sees_what_the_renderer_sees(corners, walled):
    there = Hypotheses(np.concatenate([corners, WALL, WALL[:, ::-1]]) if walled else corners)
    poses = poses_above(8)
    poses[:, 2, 3] = -0.5e-3
    for pose, penetration in zip(poses, there.rendered(*poses), strict=True):
        start = pose.copy()
        start[0, 3] += 0.02  # far off: what is seen from there is not what is seen from the pose
        fit = there.alignment.align(pose, PLACED, penetration, start)[2]
        assert fit > 1 - 1e-4, "a pixel on an edge may fall to either side"


def offset(pose: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(6,) that moves one pose to the other, in the frame of the first."""
    return kernels.logarithms((np.linalg.inv(pose) @ other)[None])[0]


def conditioned(pose, prior, error, posterior_pose, posterior, factor=1.0) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of x ~ N(pose, prior), where the sum of it and of an error N(0, error) turned out to be
    N(posterior_pose, posterior), of whose information only a factor counts: by the information of both, jointly."""
    measured = factor * (np.linalg.inv(posterior) - np.linalg.inv(prior + error))
    pull = factor * np.linalg.solve(posterior, offset(pose, posterior_pose))
    information = np.block([[np.linalg.inv(prior) + measured, measured], [measured, np.linalg.inv(error) + measured]])
    joint = np.linalg.inv(information)
    return pose @ kernels.exponentials((joint @ np.tile(pull, 2))[None, :6])[0], joint[:6, :6].copy()


def assert_same_gaussian(found, expected, error: float = 1e-6) -> None:
    """Means and covariances (..., 6, 6) are the same but for rounding."""
    np.testing.assert_allclose(found[0], expected[0], atol=error * 1e-3)
    np.testing.assert_allclose(found[1], expected[1], atol=error * np.abs(expected[1]).max(), rtol=error)


def test_one_finger_without_jitter_is_aligned_as_by_itself(hypotheses):
    poses, covariances, fits, seen, seen_covariances, descents = hypotheses.aligned(
        jitter=NOTHING, descents=1, patches=1e6
    )
    for k in range(MANY):
        pose, covariance, fit = hypotheses.align(k, NOTHING)
        np.testing.assert_array_equal(seen[k], pose)
        np.testing.assert_array_equal(seen_covariances[k], covariance)
        assert fits[k, 0] == fit
    good = fits[:, 0] > 0.6
    assert 10 < good.sum() < MANY
    # all that it is seen to be, it is
    assert_same_gaussian((poses[good], covariances[good]), (seen[good], seen_covariances[good]))
    assert (descents == 1).all()


@pytest.mark.parametrize("patches", [1e6, 0.3], ids=["whole", "weakened"])
def test_only_the_hypothesis_part_of_what_is_seen_stays(hypotheses, patches):
    poses, covariances, fits, *_ = hypotheses.aligned(descents=1, patches=patches)
    weight = 0.5 * INFORMATION * NARROWEST**2 * np.count_nonzero(hypotheses.maps)
    factors = np.minimum(patches / (1 - fits[:, 0] + FLOOR) / weight, 1)
    assert (factors[fits[:, 0] > 0.6] < 1).all() == (patches < 1)
    for k in np.flatnonzero(fits[:, 0] > 0.6):
        pose, covariance, _ = hypotheses.align(k, JITTER)
        prior = hypotheses.poses[k], hypotheses.covariances[k]
        expected = conditioned(*prior, JITTER, pose, covariance, factors[k])
        assert_same_gaussian((poses[k], covariances[k]), expected)


def test_a_hypothesis_that_explains_too_little_stays(hypotheses):
    poses, covariances, fits, seen, *_ = hypotheses.aligned(explains=0.99)
    bad = fits[:, 0] <= 0.99
    assert 0 < bad.sum() < MANY
    np.testing.assert_array_equal(poses[bad], hypotheses.poses[bad])
    np.testing.assert_array_equal(covariances[bad], hypotheses.covariances[bad])
    assert (seen[bad] != hypotheses.poses[bad]).any()
    assert (poses[~bad] != hypotheses.poses[~bad]).any(axis=(1, 2)).all()


@pytest.mark.parametrize("fingers", [1, 2])
def test_neither_threads_nor_order_nor_company_change_a_bit(hypotheses, threads, fingers):
    frame = two_fingers(hypotheses) if fingers == 2 else {}
    needed = np.random.default_rng(3).uniform(0, 1, MANY)
    threads(1)
    expected = hypotheses.aligned(needed=needed, **frame)
    order = np.random.default_rng(2).permutation(MANY)
    for count in (2, 8):
        threads(count)
        for found, value in zip(hypotheses.aligned(needed=needed, **frame), expected, strict=True):
            np.testing.assert_array_equal(found, value)
        for found, value in zip(hypotheses.aligned(order, needed=needed[order], **frame), expected, strict=True):
            np.testing.assert_array_equal(found, value[order])
    for k in range(0, MANY, 7):
        alone = slice(k, k + 1)
        for found, value in zip(hypotheses.aligned(alone, needed=needed[alone], **frame), expected, strict=True):
            np.testing.assert_array_equal(found, value[alone])


def two_fingers(hypotheses) -> dict:
    """The arguments for two gels, neither of which is the first one's."""
    gels = kernels.exponentials(np.array([[2e-3, 0, 0, 0, 0, 0.1], [-8e-3, 4e-3, 0, 0.02, 0, 0.7]]))
    return {"maps": hypotheses.rendered(*(hypotheses.truth @ gels)), "gels": gels, "finger_error": JITTER / 4}


def test_fingers_are_aligned_in_turn(hypotheses):
    frame = two_fingers(hypotheses)
    maps = np.concatenate([hypotheses.maps, frame["maps"]])
    gels = np.concatenate([np.eye(4)[None], frame["gels"]])
    found = hypotheses.aligned(**frame | {"maps": maps, "gels": gels, "descents": 1})
    for k in range(0, MANY, 3):
        pose, covariance = hypotheses.poses[k], hypotheses.covariances[k] + JITTER
        fits = []
        for number, (penetration, gel) in enumerate(zip(maps, gels, strict=True)):
            there, prior = pose @ gel, kernels.transform_covariances(covariance[None], gel)[0]
            error = frame["finger_error"] if number else NOTHING
            at, posterior, fit = hypotheses.alignment.align(there, prior + error, penetration, there)
            if number:
                at, posterior = conditioned(there, prior, error, at, posterior)
            back = np.linalg.inv(gel)
            pose, covariance = at @ back, kernels.transform_covariances(posterior[None], back)[0]
            fits.append(fit)
        np.testing.assert_allclose(found[2][k], fits, atol=1e-6)
        assert_same_gaussian((found[3][k], found[4][k]), (pose, covariance), 1e-5)


def test_descents_follow_each_other_while_they_explain_more(hypotheses):
    found = hypotheses.aligned()
    assert set(found[5]) <= {1, 2, 3, 4}
    assert len(set(found[5])) > 1
    for k in range(MANY):
        pose, covariance, fit = hypotheses.align(k, JITTER)
        best, count, more = (pose, covariance, fit), 1, True
        while more and count < 4 and best[2] < 0.95:
            prior = hypotheses.poses[k], hypotheses.covariances[k] + JITTER
            pose, covariance, fit = hypotheses.alignment.align(*prior, hypotheses.maps[0], best[0])
            count, more = count + 1, fit - best[2] >= 0.12 * (1 - best[2])
            best = max(best, (pose, covariance, fit), key=lambda each: each[2])
        np.testing.assert_array_equal(found[3][k], best[0])
        np.testing.assert_array_equal(found[4][k], best[1])
        assert (found[2][k], found[5][k]) == (best[2], count)


def test_a_start_that_is_only_a_seed_is_not_pulled_back_to(hypotheses):
    tight = np.tile(np.diag(np.repeat([3e-4, 0.01], 3) ** 2), (MANY, 1, 1))
    held, free = (hypotheses.aligned(covariances=tight, seeds=seeds) for seeds in (False, True))
    short = (held[2][:, 0] > 0.6) & (held[5] > 1)
    assert short.sum() > 10
    off = [[np.linalg.norm(offset(hypotheses.truth, pose)[:3]) for pose in found[0][short]] for found in (held, free)]
    assert np.median(off[1]) < 0.7 * np.median(off[0])
    for one, other in zip(held, free, strict=True):  # a single descent knows no difference
        np.testing.assert_array_equal(one[held[5] == 1], other[held[5] == 1])


@pytest.mark.parametrize("needed", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("fingers", [1, 2])
def test_only_hypotheses_that_fall_short_end_early(hypotheses, needed, fingers):
    frame = two_fingers(hypotheses) if fingers == 2 else {}
    full = hypotheses.aligned(**frame)
    early = hypotheses.aligned(needed=np.full(MANY, needed), **frame)
    same = np.all([(a == b).reshape(MANY, -1).all(axis=1) for a, b in zip(early, full, strict=True)], axis=0)
    fit, end = early[2].min(axis=1), full[2].min(axis=1)
    # what is not said to fall short got all that it would
    assert (fit[~same] < needed).all()
    assert (fit[end < needed] < needed).all()
    assert 0 < same.sum() < MANY
    if needed < 1.0:
        assert same[:NEAR].all()
        # from far away some get there late
        assert same[end >= needed].mean() > 0.9
    assert early[5].sum() < full[5].sum()


@pytest.mark.parametrize("height", [-0.5e-3, 2.5e-3, 0.05], ids=["pressed", "above", "far"])
def test_maps_without_any_contact(hypotheses, height):
    poses = hypotheses.poses.copy()
    poses[:, 2, 3] = height
    untouched = np.zeros((2, HEIGHT, WIDTH), np.float32)
    found = hypotheses.aligned(poses=poses, maps=untouched)
    for each in found:
        assert np.isfinite(each).all()
    assert (np.linalg.eigvalsh(found[4]) > 0).all()
    if height == 0.05:  # nothing touches, and nothing is known but what was
        assert not found[2].any()
        np.testing.assert_array_equal(found[0], poses)
        np.testing.assert_array_equal(found[1], hypotheses.covariances)
        assert_same_gaussian((found[3], found[4]), (poses, hypotheses.covariances + JITTER))


def test_no_hypotheses(hypotheses):
    shapes = [each.shape for each in hypotheses.aligned(slice(0))]
    assert shapes == [(0, 4, 4), (0, 6, 6), (0, 1), (0, 4, 4), (0, 6, 6), (0,)]


@pytest.mark.parametrize("count", [1, 2, 8])
@pytest.mark.parametrize(
    "wrong",
    [np.zeros((6, 6)), -WIDE, np.full((6, 6), 1e-4), np.full((6, 6), np.nan), np.diag([1e-6] * 5 + [-1e-20])],
    ids=["zero", "negative", "singular", "no numbers", "nearly singular"],
)
def test_what_is_no_covariance_is_refused_on_any_thread(hypotheses, threads, count, wrong):
    threads(count)
    for where in (slice(0, 1), slice(MANY - 1, MANY), slice(None)):
        covariances = hypotheses.covariances.copy()
        covariances[where] = wrong
        with pytest.raises(ValueError, match="not positive definite"):
            hypotheses.aligned(covariances=covariances, jitter=NOTHING)
    hypotheses.aligned(slice(20))  # all threads are back


def test_a_pose_that_is_not_a_number_harms_no_other(hypotheses):
    poses, expected = hypotheses.poses.copy(), hypotheses.aligned()
    poses[3] = np.nan
    others = np.arange(MANY) != 3
    for found, value in zip(hypotheses.aligned(poses=poses), expected, strict=True):
        np.testing.assert_array_equal(found[others], value[others])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"maps": np.zeros((1, HEIGHT, WIDTH - 1), np.float32)}, "another size"),
        ({"maps": np.zeros((1, WIDTH, HEIGHT), np.float32)}, "another size"),
        ({"maps": np.zeros((0, HEIGHT, WIDTH), np.float32)}, "no map"),
        ({"gels": np.tile(np.eye(4), (2, 1, 1))}, "as many gels"),
        ({"covariances": np.tile(WIDE, (MANY - 1, 1, 1))}, "as many of each"),
        ({"poses": np.tile(np.eye(4), (MANY + 1, 1, 1))}, "as many of each"),
        ({"needed": np.zeros(1)}, "as many of each"),
    ],
)
def test_what_does_not_fit_together_is_refused(hypotheses, changed, message):
    with pytest.raises(ValueError, match=message):
        hypotheses.aligned(**changed)


def test_what_a_single_hypothesis_cannot_be_aligned_to_is_refused(hypotheses):
    pose = hypotheses.truth
    with pytest.raises(ValueError, match="another size"):
        hypotheses.alignment.align(pose, WIDE, np.zeros((WIDTH, HEIGHT), np.float32), pose)
    with pytest.raises(ValueError, match="not positive definite"):
        hypotheses.alignment.align(pose, NOTHING, hypotheses.maps[0], pose)
