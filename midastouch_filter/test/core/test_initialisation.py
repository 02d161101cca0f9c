import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_filter.core.initialisation import checked_prior


def test_a_prior_that_is_nearly_rigid_is_made_so():
    pose = se3.exp([0.1, 0.2, 0.3, 1, 2, 0.5])
    pose[:3, :3] *= 1.0003
    checked = checked_prior(pose, 0.0, 3.0)
    np.testing.assert_allclose(checked[:3, :3] @ checked[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(checked, pose, atol=1e-3)


@pytest.mark.parametrize(
    ("pose", "sigma_t", "sigma_r", "said"),
    [
        (np.full((4, 4), np.nan), 0.01, 0.1, "not finite"),
        (2 * np.eye(4), 0.01, 0.1, "rigid"),
        (np.eye(3), 0.01, 0.1, "shape"),
        (se3.translation([2e3, 0, 0]), 0.01, 0.1, "from the object's origin"),
        (np.eye(4), -1.0, 0.1, "sigmas -1 m"),
        (np.eye(4), 0.01, np.inf, "sigmas .*inf rad"),
        (np.eye(4), np.nan, 0.1, "sigmas nan m"),
    ],
)
def test_what_is_no_prior_is_named(pose, sigma_t, sigma_r, said):
    with pytest.raises(InputError, match=f"prior pose: .*{said}"):
        checked_prior(pose, sigma_t, sigma_r)
