import numpy as np
import pytest

from midastouch_filter import initialisation
from midastouch_perception import se3


@pytest.mark.parametrize("n", [1, 99, 100, 101, 250])
def test_uniform_uses_every_entry_equally_often(n):
    entries = initialisation.uniform_entries(100, n, np.random.default_rng(0))
    counts = np.bincount(entries, minlength=100)
    assert len(entries) == n
    assert np.ptp(counts) <= 1


def test_gaussian_has_the_stated_spread():
    centre = se3.exp([0.1, 0.2, 0.3, 1, 2, 0.5])
    poses = initialisation.gaussian_poses(centre, 0.02, 0.3, 40_000, np.random.default_rng(0))
    np.testing.assert_allclose(poses[:, :3, 3].mean(axis=0), centre[:3, 3], atol=5e-4)
    np.testing.assert_allclose(poses[:, :3, 3].std(axis=0), 0.02, rtol=0.02)
    turn = se3.log(se3.inverse(centre) @ poses)[:, 3:]
    np.testing.assert_allclose(turn.std(axis=0), 0.3, rtol=0.02)
    np.testing.assert_allclose(np.linalg.det(poses[:, :3, :3]), 1, atol=1e-9)
