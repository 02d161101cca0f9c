"""What holds for every code network."""

import numpy as np
import pytest


@pytest.fixture(params=["tcn", "minkloc"])
def network(request):
    return request.getfixturevalue(request.param)


def test_no_maps_no_codes(network):
    assert network.encode(np.empty((0, 160, 120), np.float32)).shape == (0, network.dim)


@pytest.mark.parametrize("pixels", [0, 1])
def test_empty_and_one_point_maps_have_unit_codes(network, pixels):
    penetration = np.zeros((160, 120), np.float32)
    penetration.ravel()[:pixels] = 1e-3
    assert np.linalg.norm(network.encode(penetration)) == pytest.approx(1, abs=1e-4)
