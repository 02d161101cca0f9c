"""The whole filter on an object that is pushed, and with a sensor that is mounted askew."""

import math

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.arm_calibration.odometry_correction import without_prior
from midastouch_filter.core.alignment import Aligned


def play(world, slide, measured, **settings):
    """The filter's answers, from a start near the truth."""
    running = slide.make_filter(smoothing=False, **settings)
    running.initialise_gaussian(slide.poses[0], 5e-3, 0.1)
    return [
        running.step(odometry, touch, elapsed=0.05)
        for odometry, touch in zip(world.odometry_of(measured), slide.touches, strict=True)
    ]


def moved(estimate):
    return estimate.status.skipped.get("object_moved", 0)


@pytest.fixture(scope="module")
def jitter():
    noise = np.random.default_rng(4).standard_normal((120, 6))
    return se3.exp(noise * np.repeat([2e-4, math.radians(0.4)], 3))


def test_a_push_is_told_and_followed(world, mapped_slide, jitter):
    poses = mapped_slide.poses
    push = poses[80] @ se3.exp([2e-3, 2e-3, 4e-3, 0.06, 0.06, 0]) @ se3.inverse(poses[80])
    measured = poses @ jitter
    measured[80:] = push @ measured[80:]
    answers = play(world, mapped_slide, measured)
    first = next(i for i, answer in enumerate(answers) if moved(answer))
    assert 80 <= first <= 90
    assert "the object moved by" in answers[first].status.reason
    assert np.linalg.norm(answers[110].pose[:3, 3] - poses[110, :3, 3]) < 2e-3


def test_an_object_at_rest_is_not_said_to_move(world, mapped_slide, jitter):
    answers = play(world, mapped_slide, mapped_slide.poses @ jitter)
    assert not any(moved(answer) for answer in answers)


def test_a_mount_askew_is_learnt_and_published_with_its_uncertainty(world, mapped_slide, jitter):
    mount = se3.exp([2e-3, 0, 0, 0, 0, 0])
    found = play(world, mapped_slide, mapped_slide.poses @ mount @ jitter)[-1].calibration
    wrong = se3.log(se3.inverse(mount) @ found.mount)
    assert found.touches > 50
    assert found.known[:3].any()
    assert (np.abs(wrong) < 4 * found.sigma[:6] + [2e-4, 2e-4, 2e-4, 0.01, 0.01, 0.01]).all()


def test_both_can_be_switched_off(world, mapped_slide, jitter):
    poses = mapped_slide.poses
    measured = poses @ jitter
    measured[80:] = poses[80] @ se3.exp([0, 0, 4e-3, 0, 0, 0]) @ se3.inverse(poses[80]) @ measured[80:]
    answers = play(world, mapped_slide, measured, calibration=False, object_motion=False)
    assert answers[-1].calibration is None
    assert not any(moved(answer) for answer in answers)


def test_a_prior_is_taken_out_again():
    prior = np.diag([1e-3, 1e-3, 1e-3, 0.05, 0.05, 0.05]) ** 2
    information = np.diag([1e8, 4e6, 0, 2e4, 0, 0])  # of a map that says where three axes are
    there = np.array([3e-4, -2e-4, 0, 0.01, 0, 0])
    covariance = np.linalg.inv(information + np.linalg.inv(prior))
    posterior = Aligned(se3.exp(covariance @ information @ there), covariance, 0.0, 1.0)
    offset, said = without_prior(np.eye(4), prior, posterior)
    np.testing.assert_allclose(said, information, atol=1e-3)
    np.testing.assert_allclose(said @ offset, information @ there, rtol=0.02, atol=1e-3)
