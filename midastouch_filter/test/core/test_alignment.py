from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.touch import MAP_SCALE, Measurement, reduced_penetration
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

NOISE = NoiseModel.of(FilterConfig(penetration_noise=1e-4, penetration_correlation=3e-3))
PRIOR = np.diag([2e-3, 2e-3, 1e-3, 0.05, 0.05, 0.1]) ** 2


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_tacto").scaled(0.25)


@pytest.fixture(scope="module")
def touches(tool, sensor):
    """Poses on the tool and what they measure, averaged from full resolution."""
    sampling = ContactSampling(press=(0.5e-3, 1.2e-3), free_fraction=0.0)
    poses = sample_contact_poses(tool, 40, np.random.default_rng(0), sensor, sampling)
    maps = PenetrationRenderer(tool, sensor.scaled(4)).render(poses)
    return poses, maps.reshape(len(maps), 80, 4, 60, 4).mean(axis=(2, 4))


def errors(poses, truth):
    delta = se3.log(se3.inverse(truth) @ poses)
    return np.linalg.norm(delta[:, :3], axis=1), np.linalg.norm(delta[:, 3:], axis=1), delta


def test_finds_the_pose_that_measured_the_penetration(tool, sensor, touches):
    poses, penetrations = touches
    rng = np.random.default_rng(1)
    starts = poses @ se3.exp(rng.standard_normal((len(poses), 6)) * np.sqrt(np.diag(PRIOR)))
    alignment = PenetrationAlignment(tool, sensor, NOISE)
    aligned = [alignment.align(s, PRIOR, r) for s, r in zip(starts, penetrations, strict=True)]
    t0, r0, _ = errors(starts, poses)
    t1, r1, delta = errors(np.stack([a.pose for a in aligned]), poses)
    assert np.median(t1) < 0.35 * np.median(t0)
    assert np.median(r1) < 0.35 * np.median(r0)
    # what the press and the tilt are is measured everywhere
    assert np.median(np.abs(delta[:, 2])) < 1e-4
    nees = [d @ np.linalg.solve(a.covariance, d) for d, a in zip(delta, aligned, strict=True)]
    assert np.median(nees) < 8


def test_directions_the_contact_does_not_tell_keep_their_prior(sensor):
    """On a ball only three of six directions are measured: not the yaw, and rolling along is rotation at once."""
    ball = ObjectMesh.load(bundled_objects()["ball"])
    pose = se3.translation([0, 0, 0.029])
    penetration = PenetrationRenderer(ball, sensor).render(pose[None])[0]
    aligned = PenetrationAlignment(ball, sensor, NOISE).align(pose, PRIOR, penetration)
    gain = np.diag(aligned.covariance) / np.diag(PRIOR)
    assert gain[2] < 0.05
    assert gain[5] > 0.5
    assert np.linalg.norm(aligned.pose[:3, 3] - pose[:3, 3]) < 2e-4


@pytest.mark.parametrize("gap", [0.5e-3, 1.7e-3, 2.7e-3])
def test_a_pose_in_the_air_comes_down_to_what_was_touched(sensor, gap):
    """But not to where its prior excludes it: then the object has moved, or it is another hypothesis."""
    ball = ObjectMesh.load(bundled_objects()["ball"])
    pose, alignment = se3.translation([0, 0, 0.0295]), PenetrationAlignment(ball, sensor, NOISE)
    (penetration,) = alignment.render(pose[None])
    above = pose @ se3.translation([0, 0, penetration.max() + gap])
    assert not alignment.render(above[None]).any()
    aligned = alignment.align(above, PRIOR, penetration)
    assert abs(aligned.pose[2, 3] - pose[2, 3]) < 1e-4
    assert aligned.fit > 0.9
    if gap > 1.5e-3:
        excluded = alignment.align(above, PRIOR / 25, penetration)
        np.testing.assert_allclose(excluded.pose, above, atol=1e-9)
        assert excluded.fit < 0.9


VARIANCE = np.repeat([2e-3, np.radians(3.0)], 3) ** 2
OFF = np.array([1e-3, -8e-4, 4e-4, 0.02, -0.02, 0.02])


@pytest.fixture(scope="module")
def hand(tool):
    """Poses (2, 4, 4) of two fingers on the tool and what they measure: the second one, seen from the first."""
    sensor = SensorModel.load("digit_tacto")
    sampling = ContactSampling(press=(8e-4, 1e-3), edge_fraction=1.0, free_fraction=0.0)
    poses = sample_contact_poses(tool, 6, np.random.default_rng(4), sensor, sampling)
    # the nearest two: neither decides alone
    gaps = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=2) + np.eye(6)
    poses = poses[list(np.unravel_index(gaps.argmin(), gaps.shape))]
    first, second = (reduced_penetration(r) for r in PenetrationRenderer(tool, sensor.scaled(0.5)).render(poses))
    between = se3.inverse(poses[0]) @ poses[1]
    return poses, [Measurement(True, penetration=first), Measurement(True, penetration=second, T_gel_finger=between)]


def align_each(tool, starts, touches, **settings):
    """Hypotheses at starts (P, 4, 4), aligned to the maps of all touches."""
    sensor = SensorModel.load("digit_tacto").scaled(MAP_SCALE)
    alignment = PenetrationAlignment(tool, sensor, NoiseModel.of(FilterConfig(**settings)))
    return alignment.align_each(starts, np.tile(np.diag(VARIANCE), (len(starts), 1, 1)), touches)


def distance(a, b):
    return np.linalg.norm(a[:3, 3] - b[:3, 3])


def test_a_second_finger_makes_it_surer_and_better(tool, hand):
    poses, touches = hand
    start = poses[:1] @ se3.exp(OFF)
    one, two = align_each(tool, start, touches[:1]), align_each(tool, start, touches)
    between = touches[1].T_gel_finger
    assert two.fits.min() > 0.8
    assert np.linalg.det(two.seen_covariances[0]) < 0.5 * np.linalg.det(one.seen_covariances[0])
    assert (np.linalg.eigvalsh(two.covariances) > 0).all()
    errors = [distance(f.seen[0], poses[0]) + distance(f.seen[0] @ between, poses[1]) for f in (one, two)]
    assert errors[1] < errors[0]


def test_a_finger_that_is_not_explained_moves_nothing(tool, hand):
    poses, touches = hand
    elsewhere = touches[1].T_gel_finger @ se3.exp(np.array([0.01, 0.005, 0, 0, 0, 1.5]))
    start = poses[:1] @ se3.exp(0.2 * OFF)
    right, wrong = (align_each(tool, start, [touches[0], replace(touches[1], T_gel_finger=pose)])
                    for pose in (touches[1].T_gel_finger, elsewhere))  # fmt: skip
    assert wrong.fits[0, 1] < right.fits[0, 1] - 0.2
    np.testing.assert_array_equal(wrong.poses, start)
    assert distance(right.poses[0], poses[0]) < distance(start[0], poses[0])


def test_only_part_of_an_innovation_stays_where_the_arm_errs(tool, hand):
    poses, touches = hand
    start = poses[:1] @ se3.exp(0.5 * OFF)
    exact, rough = (align_each(tool, start, touches, jitter_translation=sigma, jitter_rotation=40 * sigma)
                    for sigma in (1e-6, 3e-3))  # fmt: skip
    (seen,) = rough.sightings()
    assert distance(seen.pose, poses[0]) < 5e-4
    assert distance(rough.poses[0], start[0]) < 0.7 * distance(exact.poses[0], start[0])
    np.testing.assert_allclose(exact.poses[0], exact.seen[0], atol=1e-4)
    assert seen.fit == rough.fits.min()


def test_a_finger_whose_pose_is_not_known_says_little(tool, hand):
    poses, touches = hand
    start = poses[:1] @ se3.exp(OFF)
    sure = align_each(tool, start, touches[1:])
    unsure = align_each(tool, start, touches[1:], finger_translation=0.02, finger_rotation=0.5)
    assert np.linalg.det(unsure.seen_covariances[0]) > 10 * np.linalg.det(sure.seen_covariances[0])
