from itertools import pairwise

import numpy as np
import pytest

from midastouch_filter.alignment import PenetrationAlignment
from midastouch_filter.config import FilterConfig
from midastouch_filter.effort import Effort
from midastouch_filter.lookup import PoseLookup
from midastouch_filter.noise_model import NoiseModel
from midastouch_filter.places import Prior, pose_distance
from midastouch_filter.reevaluation import Reevaluation
from midastouch_filter.touch import MAP_SCALE, Measurement
from midastouch_filter.workers import Workers
from midastouch_perception import se3
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.renderer import PenetrationRenderer

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
HALF_TURN = se3.make(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


def felt(penetration, log_ratio, T_gel_finger=None):
    """What one finger felt, and what its code says of every codebook entry."""
    return Measurement(True, penetration=penetration, T_gel_finger=T_gel_finger), log_ratio


def keep(reevaluation, *fingers):
    touches, log_ratios = zip(*fingers, strict=True)
    reevaluation.keep(list(touches), list(log_ratios))


def keep_three_more(slide):
    """What is felt at the slide's end, by codes that tell nothing."""
    for _ in range(3):
        keep(slide.reevaluation, felt(slide.penetrations[-1], np.zeros(len(slide.book))))


class Slide:
    """A slide over a bumpy object, with the codes' opinion that each of some places could be the right one.

    Args: world, of `conftest.py`; twofold: give the object a second half like the first.
    """

    others: tuple | list = ()  # what a second finger feels, touch by touch

    def __init__(self, world, twofold: bool, steps: int = 14):
        mesh = world.bumpy_mesh(twofold)
        coarse = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
        self.book = world.random_poses(mesh, 8000, np.random.default_rng(0))
        self.lookup = PoseLookup(self.book, Workers(1))
        self.alignment = PenetrationAlignment(mesh, coarse, NOISE)
        self.truth = world.make_slide(mesh, 6 * steps, np.random.default_rng(8))[::6]
        self.penetrations = np.maximum(PenetrationRenderer(mesh, coarse).render(self.truth), 0)

    def run(self, places: list[np.ndarray], modes: list[np.ndarray], prior: Prior | None = None):
        """Touch along the slide, then replay; `places` (4, 4): object motions after which codes fit as well."""
        self.reevaluation = reevaluation = Reevaluation(self.lookup, self.book, self.alignment, CONFIG, NOISE, Effort())
        reevaluation.restart(prior)
        self.answered = 0
        for k, penetration in enumerate(self.penetrations):
            if k:
                step = se3.inverse(self.truth[k - 1]) @ self.truth[k]
                reevaluation.moved(step, CONFIG.hindsight_spacing)
            assert reevaluation.due
            nearest = np.full(len(self.book), np.inf)
            for place in places:
                pose = place @ self.truth[k]
                gap = np.linalg.norm(self.book[:, :3, 3] - pose[:3, 3], axis=1)
                angle = se3.rotation_angle(np.swapaxes(self.book[:, :3, :3], 1, 2) @ pose[:3, :3])
                nearest = np.minimum(nearest, np.hypot(gap, 0.01 * angle))
            log_ratio = np.log(np.exp(-0.5 * (nearest / 0.008) ** 2) + 0.03) + 1.0
            keep(reevaluation, felt(penetration, log_ratio), *self.others[k : k + 1])
            assert not reevaluation.due
        for _ in range(1000):
            self.answered += 1
            answer = reevaluation.compare(modes)
            if answer is not None:
                self.exhaustive = answer.exhaustive
                return answer.places
        return None


@pytest.fixture(scope="module")
def symmetric(world):
    return Slide(world, twofold=True)


@pytest.fixture(scope="module")
def uneven(world):
    return Slide(world, twofold=False)


def odds_at(places, pose):
    return [place.log_odds for place in places if pose_distance(place.pose, pose) < 0.006]


def test_a_wrong_mode_is_found_out(uneven):
    truth = uneven.truth[-1]
    places = uneven.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth])
    assert uneven.exhaustive
    assert odds_at(places, truth) == [0.0]
    assert len(places) > 1
    assert all(place.log_odds < -3 for place in places[1:])
    distance = np.linalg.norm(places[0].pose[:3, 3] - truth[:3, 3])
    assert distance < 1.5e-3


def test_twins_are_told_as_twins(symmetric):
    truth = symmetric.truth[-1]
    places = symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth])
    assert odds_at(places, truth)[0] == pytest.approx(odds_at(places, HALF_TURN @ truth)[0], abs=0.5)


def test_what_was_known_of_the_start_decides_between_twins(symmetric):
    truth = symmetric.truth[-1]
    prior = Prior(symmetric.truth[0], 0.05, np.radians(60))
    places = symmetric.run([np.eye(4), HALF_TURN], [HALF_TURN @ truth], prior)
    assert odds_at(places, truth) == [0.0]
    # half a turn is three sigmas, and the way to the other side counts too
    assert -8 < odds_at(places, HALF_TURN @ truth)[0] < -4


def test_few_touches_say_nothing(symmetric):
    short = Slide.__new__(Slide)
    short.__dict__.update(symmetric.__dict__)
    short.truth, short.penetrations = symmetric.truth[:3], symmetric.penetrations[:3]
    assert short.run([np.eye(4)], [symmetric.truth[2]]) is None


def test_a_replay_is_done_in_slices_and_not_at_once_again(symmetric):
    truth = symmetric.truth[-1]
    assert symmetric.run([np.eye(4)], [truth]) is not None
    assert symmetric.answered > 5


def test_when_codes_say_nothing_the_comparison_is_not_exhaustive(uneven):
    everywhere = [se3.make(np.eye(3), np.array([0.0, 0.0, 0.0]))] + [
        se3.exp(np.array([0, 0, 0, *axis])) for axis in np.random.default_rng(0).standard_normal((40, 3)) * 2
    ]
    assert uneven.run(everywhere, [uneven.truth[-1]]) is not None
    assert not uneven.exhaustive


def test_covariances_are_finite_and_positive(uneven):
    places = uneven.run([np.eye(4), HALF_TURN], [uneven.truth[-1]])
    for place in places:
        assert (np.linalg.eigvalsh(0.5 * (place.covariance + place.covariance.T)) > 0).all()


def test_a_prior_is_never_more_than_a_hint():
    far = se3.make(np.eye(3), np.array([10.0, 0, 0]))
    density = Prior(np.eye(4), 0.01, 0.1).log_density(np.stack([np.eye(4), far]), -12.0)
    assert density[0] == 0
    assert density[1] == -12


def test_distances_are_continuous_at_half_turns():
    poses = [se3.exp(np.array([0, 0, 0, 0, 0, angle])) for angle in (np.pi - 0.01, np.pi, np.pi + 0.01)]
    for a, b in pairwise(poses):
        assert pose_distance(a, b) < 2e-4


def test_it_waits_longer_once_no_place_rivals_the_mode(uneven):
    truth = uneven.truth[-1]
    uneven.run([np.eye(4)], [truth])
    log_ratio = np.zeros(len(uneven.book))
    rested = []
    for _ in range(6):
        keep(uneven.reevaluation, felt(uneven.penetrations[-1], log_ratio))
        rested.append(uneven.reevaluation.rests)
    assert rested == [False, False, True, True, True, False]
    uneven.reevaluation.compare([truth])
    assert not uneven.reevaluation.rests


def test_who_asks_while_it_rests_gets_an_answer_too(uneven):
    truth = uneven.truth[-1]
    uneven.run([np.eye(4)], [truth])
    keep_three_more(uneven)
    assert uneven.reevaluation.rests
    assert any(uneven.reevaluation.compare([truth]) is not None for _ in range(300))


@pytest.mark.parametrize("lifted", [False, True])
def test_when_contradicted_it_forgets_what_was_before_a_lift(uneven, lifted):
    truth = uneven.truth[-1]
    uneven.run([np.eye(4)], [truth])
    reevaluation, modes = uneven.reevaluation, [truth, HALF_TURN @ truth]
    reevaluation.moved(np.eye(4), 8e-3, in_contact=False)
    reevaluation.moved(np.eye(4), 8e-3, in_contact=not lifted)  # 8 mm without contact are but a gap in the slide
    keep_three_more(uneven)
    reevaluation.contradicted()
    answers = [reevaluation.compare(modes) for _ in range(300)]
    assert all(answer is None for answer in answers) == lifted  # three touches say nothing
    reevaluation.contradicted()
    keep_three_more(uneven)
    assert any(reevaluation.compare(modes) is not None for _ in range(300))  # six do


def test_a_rival_ends_the_wait(uneven):
    truth = uneven.truth[-1]
    uneven.run([np.eye(4)], [truth])
    keep_three_more(uneven)
    assert uneven.reevaluation.rests
    uneven.reevaluation.compare([truth, HALF_TURN @ truth])
    assert not uneven.reevaluation.rests


def test_what_another_finger_felt_tells_twins_apart(world):
    """The first finger slides where the object looks the same after half a turn, the second where it does not."""
    mesh = world.bumpy_mesh(twofold=True, handed_below=True)
    slide = Slide.__new__(Slide)
    slide.book = world.random_poses(mesh, 8000, np.random.default_rng(0))
    slide.lookup = PoseLookup(slide.book, Workers(1))
    sensor = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
    slide.alignment = PenetrationAlignment(mesh, sensor, NOISE)
    turns = np.linspace(0, 1.5 * np.pi, 14)
    circle = 0.018 * np.stack([1.4 * np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    slide.truth, below = (world.poses_at(mesh, circle + np.array([0, 0, z]), 0.5 * turns, 1e-3) for z in (0.04, -0.04))
    renderer = PenetrationRenderer(mesh, sensor)
    slide.penetrations = np.maximum(renderer.render(slide.truth), 0)
    felt_below, between = np.maximum(renderer.render(below), 0), se3.inverse(slide.truth) @ below
    truth, wrong = slide.truth[-1], HALF_TURN @ slide.truth[-1]
    alone = slide.run([np.eye(4), HALF_TURN], [wrong])
    assert odds_at(alone, wrong)[0] > odds_at(alone, truth)[0] - 1
    silent = np.zeros(len(slide.book))
    slide.others = [felt(penetration, silent, place) for penetration, place in zip(felt_below, between, strict=True)]
    together = slide.run([np.eye(4), HALF_TURN], [wrong])
    assert odds_at(together, truth) == [0.0]
    assert odds_at(together, wrong)[0] < -8


def test_a_finger_that_the_reference_does_not_know_of_is_searched_by(uneven):
    """Codes of the second finger alone bring up the right place, where the first finger feels nothing."""
    reevaluation = Reevaluation(uneven.lookup, uneven.book, uneven.alignment, CONFIG, NOISE, Effort())
    between = se3.exp(np.array([0.02, 0, 0.05, 0.3, 0.2, 0.1]))
    for k, penetration in enumerate(uneven.penetrations):
        if k:
            step = between @ se3.inverse(uneven.truth[k - 1]) @ uneven.truth[k] @ se3.inverse(between)
            reevaluation.moved(step, CONFIG.hindsight_spacing)
        gap = np.linalg.norm(uneven.book[:, :3, 3] - uneven.truth[k][:3, 3], axis=1)
        angle = se3.rotation_angle(np.swapaxes(uneven.book[:, :3, :3], 1, 2) @ uneven.truth[k][:3, :3])
        log_ratio = np.log(np.exp(-0.5 * (np.hypot(gap, 0.01 * angle) / 0.008) ** 2) + 0.03) + 1.0
        keep(reevaluation, felt(penetration, log_ratio, between))
    truth = uneven.truth[-1] @ se3.inverse(between)
    wrong = HALF_TURN @ truth
    answer = next(filter(None, (reevaluation.compare([wrong]) for _ in range(1000))))
    assert odds_at(answer.places, truth) == [0.0]
