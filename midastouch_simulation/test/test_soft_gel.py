"""Soft gel against what is known of elastic contacts."""

from __future__ import annotations

import numpy as np
import pytest

from midastouch_simulation.soft_gel import ElasticLayer

PIXEL = 0.1e-3
ROWS, COLUMNS = np.mgrid[:160, :120] * PIXEL
RADIUS, DEPTH = 4e-3, 0.4e-3


def ball(radius: float = RADIUS, depth: float = DEPTH) -> np.ndarray:
    away = np.hypot(ROWS - 8e-3, COLUMNS - 6e-3)
    return np.where(away < radius, depth - radius + np.sqrt(np.maximum(radius**2 - away**2, 0)), -1e-3)


def contact_over_depth(thickness: float, poisson: float) -> float:
    """a^2 / (R d)."""
    bears = ElasticLayer(ROWS.shape, PIXEL, thickness, poisson).pressed(ball())[1]
    return bears.sum() * PIXEL**2 / np.pi / (RADIUS * DEPTH)


def test_a_thick_layer_is_as_hertz_has_it_a_thin_one_a_mattress():
    assert contact_over_depth(40e-3, 0.3) == pytest.approx(1.0, abs=0.06)
    assert contact_over_depth(40e-3, 0.48) == pytest.approx(1.0, abs=0.06)
    assert contact_over_depth(0.2e-3, 0.2) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("thickness", [1.5e-3, 3e-3, 6e-3])
def test_the_gel_lies_on_the_object_or_outside_of_it(thickness):
    penetration = np.maximum(ball(), np.roll(ball(2e-3, 0.2e-3), 35, axis=0))
    height, bears = ElasticLayer(ROWS.shape, PIXEL, thickness).pressed(penetration)
    assert 0 < bears.mean() < 1
    np.testing.assert_allclose(height[bears], penetration[bears], atol=1.5e-5)
    assert (height - penetration).min() > -1.5e-5


def test_a_flat_face_is_as_deep_in_its_middle_as_it_is_pressed():
    face = np.where((np.abs(ROWS - 8e-3) < 3e-3) & (np.abs(COLUMNS - 6e-3) < 2e-3), 1e-3, -1e-3)
    height, bears = ElasticLayer(ROWS.shape, PIXEL, 3e-3).pressed(face)
    assert height[80, 60] == pytest.approx(1e-3, abs=5e-6)
    assert 0.9 < bears.sum() / (face > 0).sum() <= 1
    assert 0.1e-3 < height[80, 60 + 22] < 0.9e-3  # 0.2 mm beside it the gel has sunk in
    assert -0.2e-3 < height[80, 60 + 40] < -0.01e-3  # what was displaced bulges out
