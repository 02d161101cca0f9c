import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import (
    Aligned,
    CredibleRegion,
    PenetrationAlignment,
    adjoint,
    align_in_turn,
    transform_covariance,
)
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


def test_a_pose_that_sees_nothing_far_around_stays(sensor):
    ball = ObjectMesh.load(bundled_objects()["ball"])
    pose, alignment = se3.translation([0, 0, 0.0295]), PenetrationAlignment(ball, sensor, NOISE)
    (penetration,) = alignment.render(pose[None])
    away = pose @ se3.translation([0, 0, 8e-3])
    aligned = alignment.align(away, PRIOR, penetration)
    np.testing.assert_allclose(aligned.pose, away, atol=1e-9)
    assert aligned.fit < 0.9


def test_evidence_prefers_the_right_pose(tool, sensor, touches):
    poses, penetrations = touches
    alignment = PenetrationAlignment(tool, sensor, NOISE)
    right = [alignment.align(p, PRIOR, r).log_evidence for p, r in zip(poses, penetrations, strict=True)]
    wrong = [alignment.align(p, PRIOR, r).log_evidence for p, r in zip(np.roll(poses, 1, 0), penetrations, strict=True)]
    assert (np.array(right) > np.array(wrong)).mean() > 0.9


def test_nothing_measured_is_finite(tool, sensor):
    aligned = PenetrationAlignment(tool, sensor, NOISE).align(
        se3.translation([1.0, 0, 0]), PRIOR, np.zeros((80, 60), np.float32)
    )
    np.testing.assert_allclose(aligned.covariance, PRIOR, rtol=1e-6)
    assert np.isfinite(aligned.log_evidence)


CONFIG = FilterConfig()
VARIANCE = np.repeat([2e-3, np.radians(3.0)], 3) ** 2
OFF = np.array([1e-3, -8e-4, 4e-4, 0.02, -0.02, 0.02])


@pytest.fixture(scope="module")
def hand(tool):
    """An alignment, poses (2, 4, 4) of two fingers on the tool and the penetrations they measure."""
    sensor = SensorModel.load("digit_tacto")
    sampling = ContactSampling(press=(8e-4, 1e-3), edge_fraction=1.0, free_fraction=0.0)
    poses = sample_contact_poses(tool, 6, np.random.default_rng(4), sensor, sampling)
    # the nearest two: neither decides alone
    gaps = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=2) + np.eye(6)
    poses = poses[list(np.unravel_index(gaps.argmin(), gaps.shape))]
    penetrations = [reduced_penetration(r) for r in PenetrationRenderer(tool, sensor.scaled(0.5)).render(poses)]
    alignment = PenetrationAlignment(tool, sensor.scaled(MAP_SCALE), NoiseModel.of(CONFIG))
    return alignment, poses, penetrations


def measured(penetration, T_gel_finger=None):
    return Measurement(True, penetration=penetration, T_gel_finger=T_gel_finger)


def joint(hand, start, touches, finger_error=None):
    error = CONFIG.finger_error if finger_error is None else finger_error
    return align_in_turn(hand[0], start, np.diag(VARIANCE), touches, error)


def distance(a, b):
    return np.linalg.norm(a[:3, 3] - b[:3, 3])


def test_of_the_reference_alone_it_is_the_alignment(hand):
    alignment, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    alone, found = (
        alignment.align(start, np.diag(VARIANCE), penetrations[0]),
        joint(hand, start, [measured(penetrations[0])]),
    )
    for name in ("pose", "covariance", "log_evidence", "fit"):
        np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))


def test_a_second_finger_makes_it_surer_and_better(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    between = se3.inverse(poses[0]) @ poses[1]
    one = joint(hand, start, [measured(penetrations[0])])
    two = joint(hand, start, [measured(penetrations[0]), measured(penetrations[1], between)])
    assert two.fit > 0.8
    assert np.linalg.det(two.covariance) < 0.5 * np.linalg.det(one.covariance)
    assert (np.linalg.eigvalsh(two.covariance) > 0).all()
    errors = [distance(f.pose, poses[0]) + distance(f.pose @ between, poses[1]) for f in (one, two)]
    assert errors[1] < errors[0]


def test_the_second_finger_alone_tells_of_the_reference(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    between = se3.inverse(poses[0]) @ poses[1]
    found = joint(hand, start, [measured(penetrations[1], between)])
    assert found.fit > 0.8
    gel_before, gel_after = start @ between, found.pose @ between
    assert distance(gel_after, poses[1]) < 0.6 * distance(gel_before, poses[1])


def test_the_order_of_the_fingers_does_not_matter(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(0.3 * OFF)
    between = se3.inverse(poses[0]) @ poses[1]
    touches = [measured(penetrations[0], np.eye(4)), measured(penetrations[1], between)]
    a, b = joint(hand, start, touches), joint(hand, start, touches[::-1])
    assert distance(a.pose, b.pose) < 1e-4
    assert a.log_evidence == pytest.approx(b.log_evidence, rel=0.1, abs=0.5)


def test_a_finger_that_measures_elsewhere_spoils_fit_and_evidence(hand):
    _, poses, penetrations = hand
    between = se3.inverse(poses[0]) @ poses[1]
    right = joint(hand, poses[0], [measured(penetrations[0]), measured(penetrations[1], between)])
    elsewhere = between @ se3.exp(np.array([0.01, 0.005, 0, 0, 0, 1.5]))
    wrong = joint(hand, poses[0], [measured(penetrations[0]), measured(penetrations[1], elsewhere)])
    assert wrong.fit < right.fit - 0.2
    assert wrong.log_evidence < right.log_evidence - 3


def test_a_finger_whose_pose_is_not_known_says_little(hand):
    _, poses, penetrations = hand
    start = poses[0] @ se3.exp(OFF)
    touches = [measured(penetrations[1], se3.inverse(poses[0]) @ poses[1])]
    sure, unsure = joint(hand, start, touches), joint(hand, start, touches, finger_error=np.diag(100 * VARIANCE))
    assert np.linalg.det(unsure.covariance) > np.linalg.det(sure.covariance)
    assert np.linalg.slogdet(unsure.covariance)[1] == pytest.approx(np.log(VARIANCE).sum(), abs=2)


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


def test_the_kernel_transforms_a_covariance_by_the_same_adjoint():
    rng = np.random.default_rng(0)
    motion, covariance = se3.exp(np.array([0.05, -0.02, 0.08, 0.4, -1.0, 2.0])), np.cov(rng.standard_normal((6, 20)))
    tangent = np.array([2e-3, -1e-3, 3e-3, 0.02, 0.05, -0.03])
    seen_after = se3.log(se3.inverse(motion) @ se3.exp(tangent) @ motion)
    np.testing.assert_allclose(adjoint(motion) @ tangent, seen_after, atol=1e-14)
    expected = adjoint(motion) @ covariance @ adjoint(motion).T
    np.testing.assert_allclose(transform_covariance(covariance, motion), expected, atol=1e-13)


POSE = se3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
SIGMA = np.repeat([1e-3, 0.02], 3)
INFORMED = np.array([0, 1, 1, 1, 1, 0], bool)  # axes that maps tell something of
POSTERIOR = np.diag(np.where(INFORMED, 0.1, 1.0) * SIGMA**2)


@pytest.fixture
def region():
    return CredibleRegion(NoiseModel.of(FilterConfig()))


def correct(region, steps):
    """Maps that each move the pose by a step (6,), in standard deviations of the prior."""
    for step in steps:
        region.follow(POSE, np.diag(SIGMA**2), Aligned(POSE @ se3.exp(step * SIGMA), POSTERIOR, 0.0, 1.0))


def with_fit(fit):
    return Aligned(POSE, POSTERIOR, 0.0, fit)


def test_the_less_of_the_map_is_explained_the_wider(region):
    widths = [region.widening(with_fit(fit)) for fit in (1.0, 0.97, 0.9, 0.7)]
    assert widths == sorted(widths)
    assert widths[-1] > 5 * widths[0] > 0


def test_corrections_in_one_direction_widen_and_white_ones_do_not(region):
    rng = np.random.default_rng(0)
    white = rng.standard_normal((300, 6)) * np.sqrt(0.9)
    correct(region, white)
    as_assumed = region.bias
    correct(region, white[:50] + 1.0)
    assert as_assumed < 8, "four axes of a chi-square's quarter to half each"
    assert region.bias > 5 * as_assumed
    assert region.widening(with_fit(0.98)) > 4 * CredibleRegion(NoiseModel.of(FilterConfig())).widening(with_fit(0.98))
    correct(region, white)
    assert region.bias < 8, "it is forgotten"


def test_axes_that_maps_say_nothing_of_do_not_count(region):
    correct(region, np.tile(np.where(INFORMED, 0.0, 3.0), (40, 1)))
    assert region.bias == pytest.approx(0.0, abs=1e-9)


def test_a_restart_forgets(region):
    correct(region, np.ones((40, 6)))
    assert region.bias > 10
    region.restart()
    assert region.bias == 0.0
