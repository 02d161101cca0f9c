import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_model import SensorModel

NOISE = NoiseModel.of(FilterConfig(relief_noise=1e-4, relief_correlation=3e-3))
PRIOR = np.diag([2e-3, 2e-3, 1e-3, 0.05, 0.05, 0.1]) ** 2


@pytest.fixture(scope="module")
def tool():
    return ObjectMesh.load(bundled_objects()["handle_tool"])


@pytest.fixture(scope="module")
def sensor():
    return SensorModel.load("digit_tacto").scaled(0.25)


@pytest.fixture(scope="module")
def touches(tool, sensor):
    """Poses on the tool and what they feel, averaged from full resolution."""
    sampling = ContactSampling(press=(0.5e-3, 1.2e-3), free_fraction=0.0)
    poses = sample_contact_poses(tool, 40, np.random.default_rng(0), sensor, sampling)
    maps = PenetrationRenderer(tool, sensor.scaled(4)).render(poses)
    return poses, maps.reshape(len(maps), 80, 4, 60, 4).mean(axis=(2, 4))


def errors(poses, truth):
    delta = se3.log(se3.inverse(truth) @ poses)
    return np.linalg.norm(delta[:, :3], axis=1), np.linalg.norm(delta[:, 3:], axis=1), delta


def test_finds_the_pose_that_felt_the_penetration(tool, sensor, touches):
    poses, penetrations = touches
    rng = np.random.default_rng(1)
    starts = poses @ se3.exp(rng.standard_normal((len(poses), 6)) * np.sqrt(np.diag(PRIOR)))
    alignment = PenetrationAlignment(tool, sensor, NOISE)
    aligned = [alignment.align(s, PRIOR, r) for s, r in zip(starts, penetrations, strict=True)]
    t0, r0, _ = errors(starts, poses)
    t1, r1, delta = errors(np.stack([a.pose for a in aligned]), poses)
    assert np.median(t1) < 0.35 * np.median(t0)
    assert np.median(r1) < 0.35 * np.median(r0)
    # what the press and the tilt are is felt everywhere
    assert np.median(np.abs(delta[:, 2])) < 1e-4
    nees = [d @ np.linalg.solve(a.covariance, d) for d, a in zip(delta, aligned, strict=True)]
    assert np.median(nees) < 8


def test_directions_the_contact_does_not_tell_keep_their_prior(sensor):
    """On a ball only three of six directions are felt: not the yaw, and rolling along is rotation at once."""
    ball = ObjectMesh.load(bundled_objects()["ball"])
    pose = se3.make(np.eye(3), [0, 0, 0.029])
    penetration = PenetrationRenderer(ball, sensor).render(pose[None])[0]
    aligned = PenetrationAlignment(ball, sensor, NOISE).align(pose, PRIOR, penetration)
    gain = np.diag(aligned.covariance) / np.diag(PRIOR)
    assert gain[2] < 0.05
    assert gain[5] > 0.5
    assert np.linalg.norm(aligned.pose[:3, 3] - pose[:3, 3]) < 2e-4


def test_evidence_prefers_the_right_place(tool, sensor, touches):
    poses, penetrations = touches
    alignment = PenetrationAlignment(tool, sensor, NOISE)
    right = [alignment.align(p, PRIOR, r).log_evidence for p, r in zip(poses, penetrations, strict=True)]
    wrong = [alignment.align(p, PRIOR, r).log_evidence for p, r in zip(np.roll(poses, 1, 0), penetrations, strict=True)]
    assert (np.array(right) > np.array(wrong)).mean() > 0.9


def test_nothing_felt_is_finite(tool, sensor):
    aligned = PenetrationAlignment(tool, sensor, NOISE).align(
        se3.make(np.eye(3), [1.0, 0, 0]), PRIOR, np.zeros((80, 60), np.float32)
    )
    np.testing.assert_allclose(aligned.covariance, PRIOR, rtol=1e-6)
    assert np.isfinite(aligned.log_evidence)
