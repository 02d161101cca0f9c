import numpy as np
import pytest

from midastouch_benchmark.speed.lookup import lookup_speed
from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.filter import ParticleFilter


@pytest.fixture
def running_filter(mesh, codebook, sequence, networks):
    """A filter of 5000 particles that has felt three frames."""
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
    assert speed.exact_share > 0.98
    assert 0 < speed.times.summary()["cpu"] < 1000


def test_a_leap_beyond_the_walk_s_reach_shows(running_filter, codebook):
    """A figure that were good whatever happens would say nothing."""
    speed = lookup_speed(running_filter, codebook.poses, se3.exp([0.03, 0, -0.02, 0, 2, 0]), np.random.default_rng(0))
    assert speed.exact_share < 0.9
