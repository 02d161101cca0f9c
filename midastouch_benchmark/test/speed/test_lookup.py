import numpy as np
import pytest

from midastouch_benchmark.speed.stages import lookup_speed
from midastouch_common import se3
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.filter import ParticleFilter


@pytest.fixture
def running_filter(mesh, codebook, sequence, networks):
    """A filter that has measured three frames, and compared no pose but few with them."""
    particle_filter = ParticleFilter(mesh, codebook, FilterConfig(threads=1))
    particle_filter.initialise_uniform()
    for odometry, image in zip(se3.odometry(sequence.poses_measured[:3]), map(sequence.image, range(3)), strict=True):
        touch = networks.pipeline().process(image, sequence.background)
        particle_filter.step(odometry, measurement_of(touch))
    return particle_filter


def test_a_short_step_is_followed_and_changes_no_belief(running_filter):
    untested = running_filter.belief.untested[0]
    before = untested.entries.copy()
    times, exact = lookup_speed(running_filter, se3.exp([1e-3, 0, 0, 0, 0, 0.01]))
    assert exact > 0.98
    assert 0 < times.summary()["cpu"] < 1000
    np.testing.assert_array_equal(untested.entries, before)


def test_a_leap_beyond_the_walk_s_reach_shows(running_filter):
    """A figure that were good whatever happens would say nothing."""
    assert lookup_speed(running_filter, se3.exp([0.03, 0, -0.02, 0, 2, 0]))[1] < 0.9
