"""Parts of a filter step are swapped from outside."""

from dataclasses import replace

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core import state
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.policies import default_policies

CONFIG = FilterConfig(max_particles=2000, min_particles=300, threads=1, refinement=False)
STEP = se3.exp([1e-3, 0, 0, 0, 0, 0.02])


def test_an_own_motion_model_moves_the_particles(world):
    class TwiceAsFar:
        """An arm that moves twice as far as it says."""

        def __init__(self, propagate):
            self._propagate = propagate

        def __getattr__(self, name):
            return getattr(self._propagate, name)

        def __call__(self, particles, odometry, in_contact):
            return self._propagate(particles, None if odometry is None else odometry @ odometry, in_contact)

    def make(*args):
        policies = default_policies(*args)
        return replace(policies, propagate=TwiceAsFar(policies.propagate))

    quiet = replace(CONFIG, noise_per_metre=0.0, noise_per_radian=0.0)
    filter_ = ParticleFilter(world.mesh, world.codebook, quiet, make_policies=make)
    filter_.initialise_gaussian(world.poses[0], 0.01, 0.2)
    before = filter_.poses
    filter_.step(STEP, Measurement(False))
    np.testing.assert_allclose(filter_.poses, before @ STEP @ STEP, atol=1e-6)


def test_without_resampling_weights_only_get_more_uneven(world):
    def make(*args):
        return replace(default_policies(*args), resample=lambda belief: None)

    rng = np.random.default_rng(3)
    slide = world.make_slide(world.mesh, 12, rng)
    filter_ = ParticleFilter(world.mesh, world.codebook, CONFIG, make_policies=make)
    filter_.initialise_uniform()
    sizes = []
    for motion, code in zip(se3.odometry(slide), world.encode(slide), strict=True):
        status = filter_.step(motion, Measurement(True, code)).status
        assert status.n_particles == CONFIG.max_particles
        sizes.append(status.ess)
    assert sizes[-1] < 0.5 * sizes[0]
    assert filter_.weights.sum() == pytest.approx(1)
    assert status.state in state.STATES
