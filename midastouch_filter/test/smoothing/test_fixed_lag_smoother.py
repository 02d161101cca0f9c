"""Fixed-lag smoothing in the whole filter: what the fine stage does for an answer, and what once the answer is out."""

from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.state import CONVERGED, LOST
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter


@pytest.fixture
def slide(mapped_slide):
    """make_filter(**settings), started near the truth; odometry and touches along 60 poses."""

    def make_filter(**settings) -> ParticleFilter:
        running = mapped_slide.make_filter(**settings)
        running.initialise_gaussian(mapped_slide.poses[0], 0.03, 0.3)
        return running

    return make_filter, mapped_slide.odometry[:60], mapped_slide.touches[:60]


def without_ms(status):
    return replace(status, ms={})


def test_who_does_not_ask_for_the_deferred_update_gets_the_same_answers(slide):
    make_filter, odometry, touches = slide
    asked, left_alone = make_filter(), make_filter()
    states = set()
    for motion, touch in zip(odometry, touches, strict=True):
        one, other = asked.step(motion, touch, elapsed=0.05), left_alone.step(motion, touch, elapsed=0.05)
        asked.deferred_update()
        assert without_ms(one.status) == without_ms(other.status)
        np.testing.assert_array_equal(one.pose, other.pose)
        np.testing.assert_array_equal(one.covariance, other.covariance)
        states.add(one.status.state)
    assert CONVERGED in states  # which it is not before hypotheses were compared


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_map_that_is_not_finite_is_refused_once_and_forgotten(slide, value):
    make_filter, odometry, touches = slide
    running = make_filter()
    broken = touches[30].penetration.copy()
    broken[40, 30] = value
    for k, (motion, touch) in enumerate(zip(odometry, touches, strict=True)):
        estimate = running.step(motion, replace(touch, penetration=broken) if k == 30 else touch, elapsed=0.05)
        running.deferred_update()
        assert np.isfinite(estimate.pose).all()
    assert estimate.status.skipped["bad_relief"] == 1


def test_without_kld_sampling_hypotheses_that_are_born_do_not_add_particles_for_good(mapped_slide):
    running = mapped_slide.make_filter(kld_sampling=False)
    running.initialise_uniform()
    counts = [
        running.step(motion, touch).status.n_particles
        for motion, touch in zip(mapped_slide.odometry, mapped_slide.touches, strict=True)
    ]
    assert counts[-1] == counts[0]


def test_who_asks_for_a_narrower_covariance_than_is_published_gets_no_trusted_answer(slide):
    make_filter, odometry, touches = slide
    running = make_filter(converged_error=1e-4)
    estimates = [running.step(motion, touch) for motion, touch in zip(odometry, touches, strict=True)]
    assert CONVERGED not in {each.status.state for each in estimates}
    assert any("published" in each.status.reason for each in estimates)


def test_what_maps_corrected_at_a_wrong_pose_is_not_held_against_the_right_one(mapped_slide):
    running = mapped_slide.make_filter()
    running.initialise_gaussian(mapped_slide.poses[40], 0.004, 0.1)  # the slide begins at the first one
    right, states = [], []
    for motion, touch, truth in zip(mapped_slide.odometry, mapped_slide.touches, mapped_slide.poses, strict=True):
        estimate = running.step(motion, touch)
        right.append(np.linalg.norm(estimate.pose[:3, 3] - truth[:3, 3]) < 1e-3)
        states.append(estimate.status.state)
    found = right.index(True)
    assert 4 < found < 40
    assert CONVERGED in states[found : found + 10]


def test_hypotheses_are_compared_after_the_answer(slide):
    make_filter, odometry, touches = slide
    running = make_filter()
    first, second = (
        running.step(motion, touch).status.ms for motion, touch in zip(odometry[:2], touches, strict=False)
    )
    assert "refinement" in first
    assert not {"hindsight", "track"} & set(first)
    assert {"refinement", "hindsight", "track"} <= set(second), "those of the first touch"


def test_a_comparison_goes_on_while_the_arm_rests(slide):
    make_filter, odometry, touches = slide
    running = make_filter()
    moving = [running.step(*each, elapsed=1e-3).status.state for each in zip(odometry[:40], touches, strict=False)]
    assert CONVERGED not in moving, "no frame left time for a comparison"
    resting = [running.step(np.eye(4), touches[39], elapsed=0.05) for _ in range(20)]
    first = next(each for each in resting if each.status.state == CONVERGED)
    np.testing.assert_allclose(first.pose, resting[0].pose, atol=1e-3)


def test_nothing_is_compared_in_the_air(slide):
    make_filter, odometry, touches = slide
    running = make_filter()
    for motion, touch in zip(odometry[:20], touches, strict=False):
        running.step(motion, touch, elapsed=1e-3)
    in_the_air = [running.step(np.eye(4), Measurement(False), elapsed=0.05).status.ms for _ in range(5)]
    assert not any("hindsight" in ms for ms in in_the_air[1:])


def test_a_restart_forgets_what_is_left_to_be_done(slide):
    make_filter, odometry, touches = slide
    updated, restarted = make_filter(), make_filter()
    for running in (updated, restarted):
        running.step(None, touches[0])
    updated.deferred_update()
    for running in (updated, restarted):
        running.initialise_uniform()
    ms = [running.step(odometry[1], touches[1]).status.ms for running in (updated, restarted)]
    assert "hindsight" in ms[0]
    assert "hindsight" not in ms[1]


def test_there_is_nothing_to_be_done_without_a_start(slide):
    make_filter, _, touches = slide
    running = make_filter()
    running.reset(0)
    running.step(None, touches[0])
    running.deferred_update()
    assert running.poses.shape == (0, 4, 4)


def with_ridges(touch):
    """The touch of an object that has grooves across, as wide as the ridges between them."""
    groove = np.arange(touch.penetration.shape[1]) % 6 < 3
    return replace(touch, penetration=np.where(groove, 0, touch.penetration).astype(np.float32))


@pytest.fixture
def knows_the_first(shelf):
    """(object of the shelf that is slid over, push, ridged, settings): estimates of a filter that knows the first one.

    push (4, 4): by which the object moves in the middle of the slide, unreported; ridged: the object has ridges a
    millimetre wide, which none of the shelf has, and is slid over for longer."""

    def run(touched: int, push=None, ridged=False, **settings):
        entry, (_, frames) = shelf.catalogue.entries[0], shelf.touches(touched, 300 if ridged else 130)
        if ridged:
            frames = [(each, with_ridges(touch)) for each, touch in frames]
        if push is not None:
            frames = [(push @ each if k == 65 else each, touch) for k, (each, touch) in enumerate(frames)]
        config = FilterConfig(threads=1, max_particles=2000, **settings)
        running = ParticleFilter(entry.mesh, entry.codebook, config)
        running.initialise_uniform()
        return [running.step(odometry, touch) for odometry, touch in frames]

    return run


def test_touches_of_another_object_are_said_to_be_that_and_those_of_the_own_one_never(knows_the_first):
    own, other = knows_the_first(0), knows_the_first(1, ridged=True)
    assert not any(each.status.foreign for each in own)
    assert own[-1].status.state == CONVERGED
    assert CONVERGED not in [each.status.state for each in other]
    said = [each.status for each in other if each.status.foreign]
    assert len(said) > len(other) / 10
    assert {status.state for status in said} == {LOST}
    assert all("these touches are not of this mesh" in status.reason for status in said)


def test_who_is_sure_of_the_object_is_never_told_that_it_is_another_one(knows_the_first):
    assert not any(each.status.foreign for each in knows_the_first(1, ridged=True, unknown_prior=0.0))


def test_an_object_that_is_pushed_is_no_other_one(knows_the_first):
    pushed = knows_the_first(0, push=se3.exp([0.01, 0.01, 0.0, 0.0, 0.0, 0.5]))
    assert CONVERGED in [each.status.state for each in pushed]
    assert not any(each.status.foreign for each in pushed)
