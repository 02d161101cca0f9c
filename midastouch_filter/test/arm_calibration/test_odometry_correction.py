"""The whole filter on an object that is pushed, and with a sensor that is mounted askew."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.arm_calibration.odometry_correction import ContactOdometry, OdometryCorrection, without_prior
from midastouch_filter.core.alignment import Aligned, PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.gates import Stopwatch
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.touch import Measurement
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.random_parts import random_part
from midastouch_perception.simulation.slide import measure_poses, simulate_slide


def play(world, slide, measured, **settings):
    """The filter's answers, from a start near the truth."""
    running = slide.make_filter(smoothing=False, **settings)
    running.initialise_gaussian(slide.poses[0], 5e-3, 0.1)
    return [
        running.step(odometry, touch, elapsed=0.05)
        for odometry, touch in zip(se3.odometry(measured), slide.touches, strict=True)
    ]


def moved(estimate):
    return estimate.status.skipped.get("object_moved", 0)


@pytest.fixture(scope="module")
def jitter():
    noise = np.random.default_rng(4).standard_normal((120, 6))
    return se3.exp(noise * np.repeat([2e-4, math.radians(0.4)], 3))


def test_a_push_is_reported_and_followed(world, mapped_slide, jitter):
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


SENSOR = SensorModel.load("digit_tacto").scaled(0.25)
CONFIG = FilterConfig()


@pytest.fixture
def odometry():
    return ContactOdometry(SENSOR, NoiseModel.of(CONFIG), CONFIG.object_jump + 2 * CONFIG.jitter)


@pytest.mark.parametrize("seed", [1, 9, 12])
def test_a_track_that_goes_astray_along_walls_is_no_motion_of_the_object(seed):
    """Of a sensor that measures too deep, while the belief is right all the time."""
    rng, noise = np.random.default_rng(seed), NoiseModel.of(CONFIG)
    mesh = random_part(rng, "part")
    poses = simulate_slide(mesh, SensorModel.load("digit_tacto"), 0.3, rng)
    arm = measure_poses(poses, rng)
    correction = OdometryCorrection(PenetrationAlignment(mesh, SENSOR, noise), CONFIG, noise, Stopwatch(lambda: 0.0))
    jumps = []
    for k, penetration in enumerate(1.2 * measured(mesh, poses)):
        touch = Measurement(bool(penetration.any()), penetration=penetration)
        correction(se3.inverse(arm[k - 1]) @ arm[k] if k else None, touch, 0.05)
        jumps.append(correction.jump)
        mode = SimpleNamespace(pose=poses[k])
        correction.observe(SimpleNamespace(modes=[mode], answers=[mode], aligned=(0,)), touch, trusted=True)
    assert not any(jumps)


def measured(mesh, poses):
    return np.maximum(PenetrationRenderer(mesh, SENSOR).render(np.asarray(poses)), 0)


def test_the_motion_over_a_bump_is_found_whatever_the_arm_says(world, odometry):
    rng = np.random.default_rng(3)
    wrong, misled = [], []
    for slide in (world.make_slide(world.mesh, 2, rng) for _ in range(20)):
        first, second = measured(world.mesh, slide)
        motion = se3.inverse(slide[0]) @ slide[1]
        arm = motion @ se3.exp([0, 0, 2e-3, 0, 0, 0])  # the object slips towards the gel
        odometry.keep(first, None)
        found = odometry.register(second, arm)
        wrong.append(abs((se3.inverse(motion) @ found)[2, 3]))
        misled.append(abs((se3.inverse(motion) @ arm)[2, 3]))
    assert np.median(wrong) < 0.1 * np.median(misled)


def test_where_nothing_is_measured_the_guess_stands(odometry):
    nothing = np.zeros(SENSOR.gel_depth.shape, np.float32)
    guess = se3.exp([1e-3, 0, 5e-4, 0, 0.01, 0])
    odometry.keep(nothing, None)
    np.testing.assert_allclose(odometry.register(nothing, guess), guess, atol=1e-12)


def test_there_is_no_motion_to_the_first_map(world, odometry):
    first, second = measured(world.mesh, world.poses[:2])
    assert odometry.register(first, np.eye(4)) is None
    odometry.keep(first, None)
    assert odometry.is_last(first)
    assert not odometry.is_last(second)
    odometry.restart()
    assert odometry.register(second, np.eye(4)) is None


def test_a_map_of_another_size_is_refused(odometry):
    odometry.keep(np.zeros(SENSOR.gel_depth.shape, np.float32), None)
    with pytest.raises(ValueError, match="another size"):
        odometry.register(np.zeros((4, 4), np.float32), np.eye(4))
