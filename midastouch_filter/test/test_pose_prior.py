from __future__ import annotations

import math

import numpy as np
import pytest

from midastouch_filter.pose_prior import spread_at_lever, spread_of

DIAGONAL = 0.1


def spread(*variances: float) -> tuple[float, float]:
    return spread_of(np.diag(variances), DIAGONAL)


def test_a_plain_covariance_is_taken_as_it_is():
    sigma_t, sigma_r = spread(1e-4, 1e-4, 1e-4, 0.04, 0.04, 0.04)
    assert sigma_t == pytest.approx(0.01)
    assert sigma_r == pytest.approx(0.2)


def test_the_largest_variance_counts():
    sigma_t, sigma_r = spread(1e-6, 4e-4, 1e-6, 0.01, 0.04, 0.01)
    assert sigma_t == pytest.approx(0.02)
    assert sigma_r == pytest.approx(0.2)


def test_zero_means_unknown_and_wide_is_cut_to_the_object():
    # RViz's 2D Pose Estimate: x, y 0.5 m, yaw 15 degrees, the rest zero
    assert spread(0.25, 0.25, 0, 0, 0, (math.pi / 12) ** 2) == (DIAGONAL / 3, math.radians(60))
    assert spread(0.25, 0.25, 0.25, 10, 10, 10) == (DIAGONAL / 3, math.radians(60))


def test_overconfident_is_widened():
    sigma_t, sigma_r = spread(*[1e-18] * 6)
    assert sigma_t == pytest.approx(5e-4)
    assert sigma_r == pytest.approx(math.radians(1))


def test_a_tiny_object_never_inverts_the_limits():
    assert spread_of(np.diag([1e-8] * 6), 6e-4)[0] == pytest.approx(2e-4)


def test_rotation_widens_the_position_at_the_end_of_a_lever():
    assert spread_at_lever(0.003, 0.04, 0.1) == pytest.approx(0.005)
    assert spread_at_lever(0.003, 0.04, 0.0) == pytest.approx(0.003)
