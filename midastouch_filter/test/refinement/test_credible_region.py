import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.alignment import Aligned
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.refinement.credible_region import CredibleRegion

POSE = se3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
SIGMA = np.repeat([1e-3, 0.02], 3)
TOLD = np.array([0, 1, 1, 1, 1, 0], bool)  # axes that maps tell something of
POSTERIOR = np.diag(np.where(TOLD, 0.1, 1.0) * SIGMA**2)


@pytest.fixture
def region():
    return CredibleRegion(NoiseModel.of(FilterConfig()))


def correct(region, steps):
    """Maps that each move the pose by a step (6,), in standard deviations of the prior."""
    for step in steps:
        region.follow(POSE, np.diag(SIGMA**2), Aligned(POSE @ se3.exp(step * SIGMA), POSTERIOR, 0.0, 1.0))


def aligned(fit):
    return Aligned(POSE, POSTERIOR, 0.0, fit)


def test_the_less_of_the_map_is_explained_the_wider(region):
    widths = [region.widening(aligned(fit)) for fit in (1.0, 0.97, 0.9, 0.7)]
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
    assert region.widening(aligned(0.98)) > 4 * CredibleRegion(NoiseModel.of(FilterConfig())).widening(aligned(0.98))
    correct(region, white)
    assert region.bias < 8, "it is forgotten"


def test_axes_that_maps_say_nothing_of_do_not_count(region):
    correct(region, np.tile(np.where(TOLD, 0.0, 3.0), (40, 1)))
    assert region.bias == pytest.approx(0.0, abs=1e-9)


def test_a_restart_forgets(region):
    correct(region, np.ones((40, 6)))
    assert region.bias > 10
    region.restart()
    assert region.bias == 0.0
