"""What tests of a whole filter share."""

import math

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core import state


def play(filter_, slide, frames=slice(None)):
    """The estimate after these frames of a slide, as of the fixture `coded_slide`."""
    for motion, touch in list(zip(slide.odometry, slide.touches, strict=True))[frames]:
        estimate = filter_.step(motion, touch)
    return estimate


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
    assert len(filter_.weights) == len(filter_.poses) == len(filter_.codebook_indices)


def assert_rigid(poses):
    rotation = poses[..., :3, :3]
    assert np.isfinite(poses).all()
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, -1, -2), np.broadcast_to(np.eye(3), rotation.shape), atol=1e-9
    )
    assert (np.linalg.det(rotation) > 0).all()
