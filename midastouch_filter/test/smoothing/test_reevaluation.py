from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.keyframes import KeyframeWindow
from midastouch_filter.core.lookup import PoseLookup
from midastouch_filter.core.noise_model import Effort, NoiseModel
from midastouch_filter.core.pose_hypothesis import Prior, pose_distance
from midastouch_filter.core.touch import MAP_SCALE, Measurement
from midastouch_filter.core.workers import Workers
from midastouch_filter.smoothing.pace import Pace, always, until_next_frame
from midastouch_filter.smoothing.reevaluation import Reevaluation
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
HALF_TURN = se3.make(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


def calibrated(distance):
    """Log-likelihood ratios of entries so far from a hypothesis that a code points to [m], against chance."""
    likelihood = np.exp(-0.5 * (distance / 0.008) ** 2) + 0.01
    return np.log(likelihood / likelihood.mean())


def measured(penetration, log_ratio, T_gel_finger=None):
    """What one finger measured, and what its code says of every codebook entry."""
    return Measurement(True, penetration=penetration, T_gel_finger=T_gel_finger), log_ratio


def keep(reevaluation, *fingers):
    touches, log_ratios = zip(*fingers, strict=True)
    reevaluation.keep(list(touches), list(log_ratios))


class Counted(PenetrationAlignment):
    """Counts what it does."""

    done = 0

    def align(self, *arguments):
        self.done += 1
        return super().align(*arguments)


class Slide:
    """A slide over an object, with the codes' opinion that each of some hypotheses could be the right one.

    Args: world, of `conftest.py`; mesh; truth (K, 4, 4), poses of the touches.
    """

    others: tuple | list = ()  # what a second finger measures, touch by touch
    effort = Effort()
    elapsed = None  # s between two frames
    in_time = staticmethod(always)

    def __init__(self, world, mesh, truth):
        coarse = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
        self.book = world.random_poses(mesh, 8000, np.random.default_rng(0))
        self.lookup = PoseLookup(self.book, Workers(1))
        self.alignment = Counted(mesh, coarse, NOISE)
        self.truth = truth
        self.penetrations = np.maximum(PenetrationRenderer(mesh, coarse).render(truth), 0)

    def scores(self, hypotheses: list[np.ndarray], k: int) -> np.ndarray:
        """What the code of touch k says of every codebook entry; hypotheses as of `run`."""
        nearest = np.full(len(self.book), np.inf)
        for hypothesis in hypotheses:
            pose = hypothesis @ self.truth[k]
            gap = np.linalg.norm(self.book[:, :3, 3] - pose[:3, 3], axis=1)
            angle = se3.rotation_angle(np.swapaxes(self.book[:, :3, :3], 1, 2) @ pose[:3, :3])
            nearest = np.minimum(nearest, np.hypot(gap, 0.01 * angle))
        return calibrated(nearest)

    def run(
        self,
        hypotheses: list[np.ndarray],
        modes: list[np.ndarray],
        prior: Prior | None = None,
        symmetry: ObjectSymmetry | None = None,
    ):
        """Touch along the slide, then replay; `hypotheses` (4, 4): object motions after which codes fit as well."""
        self.reevaluation = reevaluation = Reevaluation(
            self.lookup, self.alignment, symmetry or ObjectSymmetry(), POSES, CONFIG, NOISE, self.effort
        )
        reevaluation.restart(prior)
        self.slices = []  # alignments in each
        for k, penetration in enumerate(self.penetrations):
            if k:
                step = se3.inverse(self.truth[k - 1]) @ self.truth[k]
                reevaluation.moved(step, CONFIG.smoothing_spacing)
            assert reevaluation.due
            keep(reevaluation, measured(penetration, self.scores(hypotheses, k)), *self.others[k : k + 1])
            assert not reevaluation.due
        for _ in range(1000):
            before = self.alignment.done
            answer = reevaluation.compare(modes, self.elapsed, self.in_time)
            self.slices.append(self.alignment.done - before)
            if answer is not None:
                self.exhaustive, self.elsewhere, self.contest = answer.exhaustive, answer.elsewhere, answer.contest
                return answer.hypotheses
        return None


def over_bumps(world, twofold: bool) -> Slide:
    """A slide over a bumpy object; twofold: its second half is like the first."""
    mesh = world.bumpy_mesh(twofold)
    return Slide(world, mesh, world.make_slide(mesh, 84, np.random.default_rng(8))[::6])


def grooved_tube(groove: float) -> ObjectMesh:
    """A tube of 60 mm diameter and 120 mm length about z that measures the same after each `groove` [m] along z."""
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 121)[:-1], np.linspace(-0.06, 0.06, 241))
    radius = 0.03 + 0.0005 * np.cos(2 * np.pi * along / groove) + 0.001 * np.cos(3 * around)
    vertices = np.stack([radius * np.cos(around), radius * np.sin(around), along], axis=-1).reshape(-1, 3)
    corner = np.arange(240 * 120).reshape(240, 120)
    nxt = np.roll(corner, -1, axis=1)
    lower = np.stack([corner, nxt, corner + 120], axis=-1)
    upper = np.stack([nxt, nxt + 120, corner + 120], axis=-1)
    return ObjectMesh.from_arrays(vertices, np.concatenate([lower, upper]).reshape(-1, 3), "grooved")


@pytest.fixture(scope="module")
def symmetric(world):
    return over_bumps(world, twofold=True)


@pytest.fixture(scope="module")
def uneven(world):
    return over_bumps(world, twofold=False)


POSES = 1000


def probability_at(hypotheses, pose):
    return sum(hypothesis.probability for hypothesis in hypotheses if pose_distance(hypothesis.pose, pose) < 0.006)


def test_a_wrong_mode_is_found_out(uneven):
    truth = uneven.truth[-1]
    hypotheses = uneven.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth])
    assert uneven.exhaustive
    assert probability_at(hypotheses, truth) > 0.99
    assert len(hypotheses) > 1
    distance = np.linalg.norm(hypotheses[0].pose[:3, 3] - truth[:3, 3])
    assert distance < 1.5e-3


def test_a_pose_closely_beside_a_mode_is_found_as_another(world):
    mesh, angle = grooved_tube(groove=0.012), np.linspace(0, 4, 14)
    around = 0.03 * np.stack([np.cos(angle), np.sin(angle), np.zeros(14)], axis=1)
    grooved = Slide(world, mesh, world.poses_at(mesh, around, np.zeros(14), 1e-3))
    truth = grooved.truth[-1]
    beside = [se3.translation([0, 0, z]) for z in (-0.012, 0.012)]
    hypotheses = grooved.run([np.eye(4), *beside], [beside[0] @ truth])
    assert grooved.exhaustive
    fractions = [probability_at(hypotheses, pose) for pose in (truth, beside[0] @ truth, beside[1] @ truth)]
    # nothing tells them apart but how well alignment went; further along the tube and around it there are more
    assert min(fractions) > 0.04 * max(fractions)
    assert sum(fractions) > 0.3


def test_copies_are_found_as_copies(symmetric):
    truth = symmetric.truth[-1]
    hypotheses = symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth])
    fractions = probability_at(hypotheses, truth), probability_at(hypotheses, HALF_TURN @ truth)
    assert sum(fractions) > 0.95
    assert min(fractions) > 0.2


TWOFOLD = Symmetry(np.stack([np.eye(4), HALF_TURN]))


def test_copies_are_one_hypothesis_modulo_symmetry(symmetric):
    truth = symmetric.truth[-1]
    hypotheses = symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth], symmetry=ObjectSymmetry(exact=TWOFOLD))
    assert probability_at(hypotheses, HALF_TURN @ truth) > 0.95  # at the mode's side
    assert probability_at(hypotheses, truth) == 0


def test_a_look_alike_is_compared_though_no_code_speaks_for_it(uneven):
    """The codes say nothing, and the filter's mode is the wrong one."""
    truth = uneven.truth[-1]
    assert probability_at(uneven.run([], [HALF_TURN @ truth]), truth) < 0.01
    hypotheses = uneven.run([], [HALF_TURN @ truth], symmetry=ObjectSymmetry(near=TWOFOLD))
    assert probability_at(hypotheses, truth) > 100 * probability_at(hypotheses, HALF_TURN @ truth)


def test_without_room_for_the_look_alikes_nothing_is_certain(uneven, monkeypatch):
    monkeypatch.setattr(uneven, "effort", replace(Effort(), alignments=0))
    uneven.run([HALF_TURN], [HALF_TURN @ uneven.truth[-1]], symmetry=ObjectSymmetry(near=TWOFOLD))
    assert not uneven.exhaustive


def test_what_was_possible_is_compared_again_though_codes_forgot_it(symmetric):
    truth = symmetric.truth[-1]
    symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth])
    reevaluation = symmetric.reevaluation
    numbers = iter(range(len(symmetric.truth)))
    reevaluation.score_anew(lambda touch: symmetric.scores([HALF_TURN], next(numbers)), POSES)
    answer = None
    while answer is None:
        answer = reevaluation.compare([HALF_TURN @ truth])
    assert probability_at(answer.hypotheses, truth) > 0.2


def test_what_was_known_of_the_start_decides_between_copies(symmetric):
    truth = symmetric.truth[-1]
    prior = Prior(symmetric.truth[0], 0.05, np.radians(60))
    hypotheses = symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth], prior)
    assert probability_at(hypotheses, truth) > 0.9
    # half a turn is three sigmas, and the way to the other side counts too
    assert 1e-4 < probability_at(hypotheses, HALF_TURN @ truth) < 0.05


def test_a_contest_keeps_what_is_known_of_a_hypothesis_beside_it(symmetric):
    """Whichever of the two copies the start makes the more probable one."""
    orders = []
    for start in (symmetric.truth[0], HALF_TURN @ symmetric.truth[0]):
        prior = Prior(start, 0.05, np.radians(60))
        hypotheses = symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ symmetric.truth[-1]], prior)
        orders.append([hypotheses[0].pose, symmetric.contest.hypotheses[0].pose, symmetric.contest.residual_ratio[0]])
    (one, first, residual), (other, same, equal) = orders
    assert pose_distance(one, other) > 0.01
    np.testing.assert_allclose(first, same)
    np.testing.assert_allclose(residual, equal)


def test_touches_of_another_window_count_at_once(uneven):
    window = KeyframeWindow(len(uneven.truth), CONFIG.smoothing_spacing, NOISE.touch_correlation, shortlist=80)
    scores = {}
    for k, penetration in enumerate(uneven.penetrations):
        if k:
            window.moved(se3.inverse(uneven.truth[k - 1]) @ uneven.truth[k], CONFIG.smoothing_spacing, in_contact=True)
        touch, score = measured(penetration, uneven.scores([np.eye(4), HALF_TURN], k))
        scores[id(touch)] = score
        window.keep([touch], [score])
    reevaluation = Reevaluation(uneven.lookup, uneven.alignment, ObjectSymmetry(), POSES, CONFIG, NOISE, Effort())
    assert reevaluation.rests(contradicted=True)
    reevaluation.recall(window, lambda touch: scores[id(touch)])
    assert not reevaluation.rests(contradicted=False)
    answers = (reevaluation.compare([HALF_TURN @ uneven.truth[-1]]) for _ in range(1000))
    found = next(answer for answer in answers if answer is not None)
    assert probability_at(found.hypotheses, uneven.truth[-1]) > 0.99


def test_one_touch_says_nothing(symmetric):
    short = Slide.__new__(Slide)
    short.__dict__.update(symmetric.__dict__)
    short.truth, short.penetrations = symmetric.truth[:1], symmetric.penetrations[:1]
    short.run([np.eye(4)], [symmetric.truth[0]])
    assert short.reevaluation.rests(contradicted=True)


def test_a_comparison_is_done_in_slices_and_not_at_once_again(symmetric):
    truth = symmetric.truth[-1]
    assert symmetric.run([np.eye(4), HALF_TURN], [truth]) is not None
    most = Pace(symmetric.effort).alignments
    assert sum(symmetric.slices) > 2 * most
    assert max(symmetric.slices) <= most
    assert symmetric.reevaluation.rests(contradicted=False)


def test_a_fast_camera_s_frames_are_given_less_work(symmetric, monkeypatch):
    truth, effort = symmetric.truth[-1], symmetric.effort
    at_leisure = symmetric.run([np.eye(4), HALF_TURN], [truth])
    monkeypatch.setattr(symmetric, "elapsed", 1 / 60)
    found = symmetric.run([np.eye(4), HALF_TURN], [truth])
    # one start is not broken off in the middle of its descents
    assert max(symmetric.slices) < effort.alignments_per_second / 60 + 8
    assert [each.probability for each in found] == [each.probability for each in at_leisure]


def test_work_whose_time_is_up_waits_for_the_next_frame(symmetric, monkeypatch):
    truth = symmetric.truth[-1]
    at_leisure = symmetric.run([np.eye(4), HALF_TURN], [truth])
    monkeypatch.setattr(symmetric, "in_time", lambda: False)
    found = symmetric.run([np.eye(4), HALF_TURN], [truth])
    # one start is not broken off in the middle of its descents
    assert max(symmetric.slices) < Pace(symmetric.effort).alignments / 4 + 8
    assert [each.probability for each in found] == [each.probability for each in at_leisure]


def test_a_frame_s_time_is_half_of_that_between_two():
    now = [5.0]
    in_time = until_next_frame(0.1, lambda: now[0])
    now[0] = 5.04
    assert in_time()
    now[0] = 5.06
    assert not in_time()
    assert until_next_frame(None, lambda: now[0])()


def test_when_codes_say_nothing_the_comparison_is_not_exhaustive(uneven, monkeypatch):
    monkeypatch.setattr(uneven, "effort", Effort(alignments=100))
    everywhere = [se3.translation([0.0, 0.0, 0.0])] + [
        se3.exp(np.array([0, 0, 0, *axis])) for axis in np.random.default_rng(0).standard_normal((40, 3)) * 2
    ]
    assert uneven.run(everywhere, [uneven.truth[-1]]) is not None
    assert not uneven.exhaustive


def test_covariances_are_finite_and_positive(uneven):
    hypotheses = uneven.run([np.eye(4), HALF_TURN], [uneven.truth[-1]])
    for hypothesis in hypotheses:
        assert (np.linalg.eigvalsh(0.5 * (hypothesis.covariance + hypothesis.covariance.T)) > 0).all()


def test_a_prior_is_never_more_than_a_hint():
    far = se3.translation([10.0, 0, 0])
    density = Prior(np.eye(4), 0.01, 0.1).log_density(np.stack([np.eye(4), far]), -12.0, Symmetry())
    assert density[0] == 0
    assert density[1] == -12


def test_distances_are_continuous_at_half_turns():
    poses = [se3.exp(np.array([0, 0, 0, 0, 0, angle])) for angle in (np.pi - 0.01, np.pi, np.pi + 0.01)]
    for a, b in pairwise(poses):
        assert pose_distance(a, b) < 2e-4


def next_touch(slide):
    """One more touch, where the slide ends, by codes that tell nothing."""
    slide.reevaluation.moved(se3.exp([CONFIG.smoothing_spacing, 0, 0, 0, 0, 0]), CONFIG.smoothing_spacing)
    keep(slide.reevaluation, measured(slide.penetrations[-1], np.zeros(len(slide.book))))


def test_it_waits_ever_longer_unless_contradicted(uneven):
    truth = uneven.truth[-1]
    uneven.run([np.eye(4)], [truth])
    waited = []
    for _ in range(3):
        waited.append(0)
        while uneven.reevaluation.rests(contradicted=False):
            next_touch(uneven)
            waited[-1] += 1
        while uneven.reevaluation.compare([truth]) is None:
            pass
    assert waited[0] < waited[-1] <= Effort().rarely
    next_touch(uneven)
    assert uneven.reevaluation.rests(contradicted=False)
    assert not uneven.reevaluation.rests(contradicted=True)


def test_what_was_asked_before_a_lift_is_not_answered(uneven):
    truth = uneven.truth[-1]
    uneven.run([np.eye(4)], [truth])
    next_touch(uneven)
    assert uneven.reevaluation.compare([truth]) is None
    uneven.reevaluation.moved(np.eye(4), 0.02, in_contact=False)
    next_touch(uneven)
    assert not uneven.reevaluation.rests(contradicted=False)  # it starts anew
    answer = next(filter(None, (uneven.reevaluation.compare([truth]) for _ in range(1000))))
    assert answer.elsewhere > 0


def test_an_object_moved_unreported_is_found_where_it_is_now(uneven):
    """The sensor is lifted after the first half; the second half is measured as if the object had been turned
    before."""
    half = len(uneven.truth) // 2
    moved = Slide.__new__(Slide)
    moved.__dict__.update(uneven.__dict__)
    moved.run([np.eye(4)], [uneven.truth[-1]])
    reevaluation, book = moved.reevaluation, uneven.book
    reevaluation.moved(np.eye(4), 0.02, in_contact=False)
    wrong = uneven.truth[-1]  # where continuity puts the sensor
    for k in range(half):
        if k:
            step = se3.inverse(uneven.truth[k - 1]) @ uneven.truth[k]
            reevaluation.moved(step, CONFIG.smoothing_spacing)
            wrong = wrong @ step
        gap = np.linalg.norm(book[:, :3, 3] - uneven.truth[k][:3, 3], axis=1)
        angle = se3.rotation_angle(np.swapaxes(book[:, :3, :3], 1, 2) @ uneven.truth[k][:3, :3])
        log_ratio = calibrated(np.hypot(gap, 0.01 * angle))
        keep(reevaluation, measured(uneven.penetrations[k], log_ratio))
    answer = next(filter(None, (reevaluation.compare([wrong]) for _ in range(1000))))
    assert probability_at(answer.hypotheses, uneven.truth[half - 1]) > 0.9
    assert probability_at(answer.hypotheses, wrong) < 0.01


def test_what_another_finger_measured_tells_copies_apart(world):
    """The first finger slides where the object looks the same after half a turn, the second where it does not."""
    mesh = world.bumpy_mesh(twofold=True, handed_below=True)
    slide = Slide.__new__(Slide)
    slide.book = world.random_poses(mesh, 8000, np.random.default_rng(0))
    slide.lookup = PoseLookup(slide.book, Workers(1))
    sensor = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
    slide.alignment = Counted(mesh, sensor, NOISE)
    turns = np.linspace(0, 1.5 * np.pi, 14)
    circle = 0.018 * np.stack([1.4 * np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    slide.truth, below = (world.poses_at(mesh, circle + np.array([0, 0, z]), 0.5 * turns, 1e-3) for z in (0.04, -0.04))
    renderer = PenetrationRenderer(mesh, sensor)
    slide.penetrations = np.maximum(renderer.render(slide.truth), 0)
    measured_below, between = np.maximum(renderer.render(below), 0), se3.inverse(slide.truth) @ below
    truth, wrong = slide.truth[-1], HALF_TURN @ slide.truth[-1]
    alone = slide.run([np.eye(4), HALF_TURN], [wrong])
    assert probability_at(alone, wrong) > 0.1
    silent = np.zeros(len(slide.book))
    slide.others = [
        measured(penetration, silent, hypothesis)
        for penetration, hypothesis in zip(measured_below, between, strict=True)
    ]
    together = slide.run([np.eye(4), HALF_TURN], [wrong])
    assert probability_at(together, truth) > 0.9
    assert probability_at(together, wrong) < 1e-3


def test_a_finger_that_the_reference_does_not_know_of_is_searched_by(uneven):
    """Codes of the second finger alone bring up the right hypothesis, where the first finger measures nothing."""
    reevaluation = Reevaluation(uneven.lookup, uneven.alignment, ObjectSymmetry(), POSES, CONFIG, NOISE, Effort())
    between = se3.exp(np.array([0.02, 0, 0.05, 0.3, 0.2, 0.1]))
    for k, penetration in enumerate(uneven.penetrations):
        if k:
            step = between @ se3.inverse(uneven.truth[k - 1]) @ uneven.truth[k] @ se3.inverse(between)
            reevaluation.moved(step, CONFIG.smoothing_spacing)
        gap = np.linalg.norm(uneven.book[:, :3, 3] - uneven.truth[k][:3, 3], axis=1)
        angle = se3.rotation_angle(np.swapaxes(uneven.book[:, :3, :3], 1, 2) @ uneven.truth[k][:3, :3])
        log_ratio = calibrated(np.hypot(gap, 0.01 * angle))
        keep(reevaluation, measured(penetration, log_ratio, between))
    truth = uneven.truth[-1] @ se3.inverse(between)
    wrong = HALF_TURN @ truth
    answer = next(filter(None, (reevaluation.compare([wrong]) for _ in range(1000))))
    assert probability_at(answer.hypotheses, truth) > 0.9
