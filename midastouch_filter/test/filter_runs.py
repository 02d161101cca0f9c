"""What tests of a whole filter share."""

import math
from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core import state
from midastouch_filter.core.belief import Hypotheses
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.workers import Workers
from midastouch_perception.codebook import FORMAT
from midastouch_perception.symmetry.search import ObjectSymmetry


def model_of(world, codebook=None, **settings):
    """What a filter knows of the world's object."""
    config = FilterConfig(**{"threads": 1, **settings})
    return ObjectModel(world.mesh, codebook or world.codebook, config, NoiseModel.of(config), Workers(1))


def hypotheses_at(poses, log_weights, sigma_t=5e-4, sigma_r=0.01, numbers=0):
    """Hypotheses at poses (n, 4, 4), all equally well known, on objects of these numbers."""
    out = Hypotheses.at(poses, np.diag(np.repeat([sigma_t, sigma_r], 3) ** 2), log_weights, 0, 0.0)
    return replace(out, objects=np.broadcast_to(np.asarray(numbers, np.int32), len(poses)).copy())


def play(filter_, slide, frames=slice(None), elapsed=None):
    """The estimate after these frames of a slide, as of the fixtures `coded_slide` and `mapped_slide`."""
    for motion, touch in list(zip(slide.odometry, slide.touches, strict=True))[frames]:
        estimate = filter_.step(motion, touch, elapsed=elapsed)
    return estimate


def go_on(filter_, poses, touches, elapsed=None):
    """The estimates at poses (n, 4, 4) but the first one, where the sensor is, with what it measures there."""
    steps = zip(se3.inverse(poses[:-1]) @ poses[1:], touches[1:], strict=True)
    return [filter_.step(motion, touch, elapsed=elapsed) for motion, touch in steps]


def error(estimate, truth):
    """Of the pose: m, rad."""
    between = se3.inverse(truth) @ estimate.pose
    return np.linalg.norm(between[:3, 3]), se3.rotation_angle(between[:3, :3])


def skipped(estimate, name):
    """How often a gate of that name has skipped or refused something."""
    return estimate.status.skipped.get(name, 0)


def codes_along(world, n):
    """Motions and codes along a slide of n frames."""
    truth = world.make_slide(world.mesh, n, np.random.default_rng(3))
    return list(zip(se3.odometry(truth), world.encode(truth), strict=True))


def meta_of(mesh, **other):
    """Meta data of a codebook file of a mesh from a file: without symmetries, to search for which takes seconds."""
    out = {"format": FORMAT, "mesh_name": mesh.name, "mesh_sha256": mesh.sha256, "mesh_path": str(mesh.path or "")}
    out |= {"sensor": "digit_tacto", "sensor_id": "", "symmetry": ObjectSymmetry().as_json()}
    return out | {"temperature": 0.1, "outlier": 0.05} | other


def some_book(world, mesh, n=300, **changes):
    """A codebook of random contact poses on any mesh; changes of its meta data."""
    poses = world.random_poses(mesh, n, np.random.default_rng(2))
    book = world.make_codebook(poses, world.encode(poses), world.of_surface if mesh is world.mesh else None)
    book.meta = {**book.meta, **changes}
    return book


def assert_defined(filter_, estimate):
    """Every number is finite, and the state has a reason."""
    status = estimate.status
    assert status.state in state.STATES
    assert status.reason
    numbers = [status.ess, status.mode_mass, status.spread_t, status.spread_r, status.likelihood_trend]
    assert np.isfinite(numbers).all()
    assert estimate.modes
    for mode in estimate.modes:
        assert math.isfinite(mode.weight)
        assert np.isfinite(mode.covariance).all()
        assert_rigid(mode.pose)
    assert np.isfinite(estimate.covariance).all()
    assert_rigid(filter_.poses)
    assert np.isfinite(filter_.weights).all()
    assert filter_.weights.sum() == pytest.approx(1)
    assert len(filter_.weights) == len(filter_.poses)


def assert_rigid(poses):
    rotation = poses[..., :3, :3]
    assert np.isfinite(poses).all()
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, -1, -2), np.broadcast_to(np.eye(3), rotation.shape), atol=1e-9
    )
    assert (np.linalg.det(rotation) > 0).all()
