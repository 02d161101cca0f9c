import numpy as np
import pytest
import trimesh

from midastouch_benchmark.speed.lookup import AlikeCopies, lookup_speed
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.filter import ParticleFilter
from midastouch_perception.codebook import Codebook


@pytest.fixture
def running_filter(mesh, codebook, sequence, networks):
    """A filter of 5000 particles that has measured three frames."""
    particle_filter = ParticleFilter(mesh, codebook, FilterConfig(min_particles=5000, max_particles=5000))
    particle_filter.initialise_gaussian(sequence.poses_true[0], 0.003, 0.1)
    for i in range(3):
        odometry = se3.inverse(sequence.poses_measured[i - 1]) @ sequence.poses_measured[i] if i else None
        particle_filter.step(
            odometry, measurement_of(networks.pipeline().process(sequence.image(i), sequence.background))
        )
    return particle_filter


def test_a_short_step_is_followed_exactly(running_filter, codebook):
    speed = lookup_speed(running_filter, codebook.poses, se3.exp([1e-3, 0, 0, 0, 0, 0.01]), np.random.default_rng(0))
    assert speed.exact_fraction > 0.98
    assert 0 < speed.times.summary()["cpu"] < 1000


def test_a_leap_beyond_the_walk_s_reach_shows(running_filter, codebook):
    """A figure that were good whatever happens would say nothing."""
    speed = lookup_speed(running_filter, codebook.poses, se3.exp([0.03, 0, -0.02, 0, 2, 0]), np.random.default_rng(0))
    assert speed.exact_fraction < 0.9


COUNT = 3


@pytest.fixture(scope="module")
def copies():
    box = trimesh.creation.box((0.04, 0.02, 0.03))
    mesh = ObjectMesh.from_arrays(box.vertices, box.faces, "box")
    rng = np.random.default_rng(0)
    points, normals, _ = mesh.sample_surface(600, rng)
    poses = se3.make(se3.frame_from_normal(normals, rng.uniform(0, 6, len(points))), points)
    codes = np.eye(8, dtype=np.float32)[rng.integers(0, 8, len(poses))]
    return AlikeCopies(mesh, Codebook(poses, codes, {"temperature": 0.1, "outlier": 0.05}), COUNT)


def test_copies_are_alike_and_apart(copies):
    assert copies.mesh.area == pytest.approx(COUNT * 2 * (0.04 * 0.02 + 0.04 * 0.03 + 0.02 * 0.03))
    poses = copies.codebook.poses.reshape(COUNT, 200, 4, 4)
    shift = poses[:, 0, :3, 3] - poses[0, 0, :3, 3]
    np.testing.assert_allclose(shift, np.outer(np.arange(COUNT), [0, 0.05, 0]), atol=1e-12)
    for copy, offset in zip(poses, shift, strict=True):
        np.testing.assert_allclose(copy[:, :3, 3], poses[0, :, :3, 3] + offset)
    np.testing.assert_array_equal(copies.codebook.codes[:200], copies.codebook.codes[-200:])


def test_a_pose_is_found_on_every_copy(copies):
    poses = copies.on_every_copy(copies.codebook.poses[7])
    np.testing.assert_allclose(poses, copies.codebook.poses[7::200], atol=1e-12)
