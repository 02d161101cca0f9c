import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.joint_alignment import align_in_turn, transform_covariance
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.touch import MAP_SCALE, Measurement, reduced_penetration
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

CONFIG = FilterConfig()
PRIOR = np.repeat([2e-3, np.radians(3.0)], 3) ** 2
OFF = np.array([1e-3, -8e-4, 4e-4, 0.02, -0.02, 0.02])


@pytest.fixture(scope="module")
def hand():
    """An alignment, poses (2, 4, 4) of two fingers on the tool and the penetrations they feel."""
    tool = ObjectMesh.load(bundled_objects()["handle_tool"])
    sensor = SensorModel.load("digit_tacto")
    sampling = ContactSampling(press=(8e-4, 1e-3), edge_fraction=1.0, free_fraction=0.0)
    poses = sample_contact_poses(tool, 6, np.random.default_rng(4), sensor, sampling)
    # the nearest two: neither decides alone
    gaps = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=2) + np.eye(6)
    poses = poses[list(np.unravel_index(gaps.argmin(), gaps.shape))]
    penetrations = [reduced_penetration(r) for r in PenetrationRenderer(tool, sensor.scaled(0.5)).render(poses)]
    alignment = PenetrationAlignment(tool, sensor.scaled(MAP_SCALE), NoiseModel.of(CONFIG))
    return alignment, poses, penetrations


def felt(penetration, T_gel_finger=None):
    return Measurement(True, penetration=penetration, T_gel_finger=T_gel_finger)


def aligned(hand, start, touches, finger_error=None):
    error = CONFIG.finger_error if finger_error is None else finger_error
    return align_in_turn(hand[0], start, np.diag(PRIOR), touches, error)


def distance(a, b):
    return np.linalg.norm(a[:3, 3] - b[:3, 3])


def test_of_the_reference_alone_it_is_the_alignment(hand):
    alignment, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    alone, joint = (
        alignment.align(start, np.diag(PRIOR), penetrations[0]),
        aligned(hand, start, [felt(penetrations[0])]),
    )
    for name in ("pose", "covariance", "log_evidence", "fit"):
        np.testing.assert_array_equal(getattr(joint, name), getattr(alone, name))


def test_a_second_finger_makes_it_surer_and_better(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    between = se3.inverse(poses[0]) @ poses[1]
    one = aligned(hand, start, [felt(penetrations[0])])
    two = aligned(hand, start, [felt(penetrations[0]), felt(penetrations[1], between)])
    assert two.fit > 0.8
    assert np.linalg.det(two.covariance) < 0.5 * np.linalg.det(one.covariance)
    assert (np.linalg.eigvalsh(two.covariance) > 0).all()
    errors = [distance(f.pose, poses[0]) + distance(f.pose @ between, poses[1]) for f in (one, two)]
    assert errors[1] < errors[0]


def test_the_second_finger_alone_tells_of_the_reference(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    between = se3.inverse(poses[0]) @ poses[1]
    found = aligned(hand, start, [felt(penetrations[1], between)])
    assert found.fit > 0.8
    gel_before, gel_after = start @ between, found.pose @ between
    assert distance(gel_after, poses[1]) < 0.6 * distance(gel_before, poses[1])


def test_the_order_of_the_fingers_does_not_matter(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(0.3 * OFF)
    between = se3.inverse(poses[0]) @ poses[1]
    touches = [felt(penetrations[0], np.eye(4)), felt(penetrations[1], between)]
    a, b = aligned(hand, start, touches), aligned(hand, start, touches[::-1])
    assert distance(a.pose, b.pose) < 1e-4
    assert a.log_evidence == pytest.approx(b.log_evidence, rel=0.1, abs=0.5)


def test_a_finger_that_feels_another_place_spoils_fit_and_evidence(hand):
    _, poses, penetrations = hand
    between = se3.inverse(poses[0]) @ poses[1]
    right = aligned(hand, poses[0], [felt(penetrations[0]), felt(penetrations[1], between)])
    elsewhere = between @ se3.exp(np.array([0.01, 0.005, 0, 0, 0, 1.5]))
    wrong = aligned(hand, poses[0], [felt(penetrations[0]), felt(penetrations[1], elsewhere)])
    assert wrong.fit < right.fit - 0.2
    assert wrong.log_evidence < right.log_evidence - 3


def test_a_finger_whose_place_is_not_known_says_little(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    touches = [felt(penetrations[1], se3.inverse(poses[0]) @ poses[1])]
    sure, unsure = aligned(hand, start, touches), aligned(hand, start, touches, finger_error=np.diag(100 * PRIOR))
    assert np.linalg.det(unsure.covariance) > np.linalg.det(sure.covariance)
    assert np.linalg.slogdet(unsure.covariance)[1] == pytest.approx(np.log(PRIOR).sum(), abs=2)


def test_a_covariance_is_transformed_as_samples_are():
    rng = np.random.default_rng(0)
    half = rng.standard_normal((6, 6)) * np.repeat([1e-3, 1e-2], 3)[:, None]
    covariance = half @ half.T
    motion = se3.exp(np.array([0.05, -0.02, 0.08, 0.4, -1.0, 2.0]))
    samples = se3.exp(rng.multivariate_normal(np.zeros(6), covariance, 20_000)) @ motion
    deviations = se3.log(se3.inverse(motion) @ samples)
    empirical = np.cov(deviations.T)
    scale = np.sqrt(np.diag(empirical))
    np.testing.assert_allclose(
        transform_covariance(covariance, motion) / np.outer(scale, scale), empirical / np.outer(scale, scale), atol=0.05
    )
    np.testing.assert_allclose(
        transform_covariance(transform_covariance(covariance, motion), se3.inverse(motion)), covariance, atol=1e-12
    )
