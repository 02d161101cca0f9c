"""A mesh of another size than the object is told by the path over it."""

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_filter.core.mesh_scale import MeshScale

REGION = 0.7e-3  # m


def fault(scale: float, noise: float = 0.3e-3, length: float = 0.08) -> str:
    """What is said of a mesh after a bent path by odometry, seen on a mesh of another size, turned and noisy."""
    rng = np.random.default_rng(0)
    along = np.linspace(0, 1, 100)[:, None]
    path = length * np.concatenate([along, 0.5 * along**2, 0.2 * np.sin(5 * along)], axis=1)
    turn = se3.random_rotations(1, rng)[0]
    found = MeshScale()
    for by_odometry in path:
        found.add(by_odometry, scale * turn @ by_odometry + [0.1, 0.2, 0.3] + rng.normal(0, noise, 3))
    return found.fault(REGION)


@pytest.mark.parametrize(("scale", "words"), [(1.05, "5% too large"), (0.95, "5% too small"), (1.0, ""), (1.005, "")])
def test_the_size_of_a_mesh_is_told_by_a_long_path(scale, words):
    assert fault(scale).endswith(words)
    assert bool(fault(scale)) == bool(words)


def test_nothing_is_told_by_a_short_or_unclear_path_or_after_a_restart():
    assert not fault(1.05, length=0.01)
    assert not fault(1.05, noise=3e-3)
    scale = MeshScale()
    assert not scale.fault(REGION)
    for x in np.linspace(0, 1, 10):
        assert not scale.fault(REGION) or x > 0.1
        scale.add(np.full(3, x), np.full(3, 1.1 * x))
    assert scale.fault(REGION)
    scale.restart()
    assert not scale.fault(REGION)
