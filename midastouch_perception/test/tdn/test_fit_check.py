import numpy as np
import pytest

from midastouch_perception.rendering.renderer import GelShape
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.fit_check import (
    EXPLAINED_LIMIT,
    QUIET_LIMIT,
    FitCheck,
    explained_fraction,
    far_change,
    quietest_tenth,
)

REAL = SensorModel.load("digit_real").for_maps


def bump(row=80, column=60, radius=25.0, depth=1e-3) -> np.ndarray:
    """A round press (160, 120) m."""
    rows, columns = np.mgrid[:160, :120]
    squared = ((rows - row) ** 2 + (columns - column) ** 2) / radius**2
    return (depth * np.maximum(0, 1 - squared)).astype(np.float32)


def lit(penetration: np.ndarray, gain: float = 5e5) -> np.ndarray:
    """Difference image (160, 120, 3) under lights from three sides."""
    down, right = np.gradient(penetration)
    angles = np.radians([150.0, 30.0, 270.0])
    return np.stack([gain * (right * np.cos(a) - down * np.sin(a)) for a in angles], axis=-1).astype(np.float32)


def show(check: FitCheck, difference: np.ndarray, penetration: np.ndarray, frames: int = 1) -> None:
    """Frames of a sensor without calibration and drift."""
    for _ in range(frames):
        check.observe(difference, difference, penetration)


@pytest.fixture
def noise():
    return np.random.default_rng(0).normal(0, 1.0, (160, 120, 3)).astype(np.float32)


@pytest.mark.parametrize("gain", [2e5, -5e5, 4e6])
def test_a_penetration_map_explains_its_own_light(noise, gain):
    penetration = bump()
    assert explained_fraction(lit(penetration, gain) + noise, penetration, REAL.pixel_size) > 0.9


def test_another_penetration_map_does_not(noise):
    assert explained_fraction(lit(bump(60, 40)) + noise, bump(100, 85), REAL.pixel_size) < 0.3
    nothing = np.zeros((160, 120), np.float32)
    assert explained_fraction(lit(bump()) + noise, nothing, REAL.pixel_size) == pytest.approx(0, abs=1e-6)
    assert explained_fraction(noise, bump(), REAL.pixel_size) is None
    assert explained_fraction(np.zeros_like(noise), nothing, REAL.pixel_size) is None


def test_light_that_drifts_and_gel_that_sinks_in_are_explained(noise):
    rows, columns = np.mgrid[-1:1:160j, -1:1:120j]
    drift = 12 * (columns + rows * columns)[..., None] * [1, -0.5, 0.3]
    assert explained_fraction(lit(bump()) + drift.astype(np.float32) + noise, bump(), REAL.pixel_size) > 0.9
    touched, gel = bump(), GelShape(0.6e-3, 1.0, 0.3e-3)
    assert explained_fraction(lit(gel.height(touched, REAL.pixel_size)) + noise, touched, REAL.pixel_size) > 0.9


def test_a_contact_leaves_a_tenth_of_the_image_alone(noise):
    assert quietest_tenth(lit(bump(radius=60)) + noise) < 1
    assert quietest_tenth(lit(bump()) + 8 + noise) == pytest.approx(8, abs=0.5)


def test_verdict_needs_several_frames_and_looks_at_every_nth(noise):
    check = FitCheck(REAL, every=2, window=6)
    for frames in range(1, 9):
        show(check, lit(bump()) + noise, bump(110, 90))
        assert bool(check.problem) == (frames >= 3), "two of a window of six are a third"
    assert check.explained < EXPLAINED_LIMIT[REAL.light]
    assert "explains" in check.problem
    assert check.quiet < QUIET_LIMIT


def test_one_odd_frame_is_no_misfit(noise):
    check = FitCheck(REAL, every=1, window=6)
    for k in range(6):
        show(check, lit(bump()) + noise, bump(110, 90) if k == 2 else bump())
    assert check.problem == ""
    assert float(check.values["explained_share"]) > 0.9


def test_a_background_that_is_off_everywhere_comes_first(noise):
    check = FitCheck(REAL, every=1, window=3)
    show(check, lit(bump()) + noise + 20, bump(), frames=3)
    assert "off by 20 grey levels" in check.problem
    assert "capture_background" in check.problem
    check.reset()
    assert check.problem == ""
    assert check.values == {"quietest_tenth": "", "far_change": "", "explained_share": ""}


def test_only_a_tint_far_from_all_contact_is_reported(noise):
    check, tint = FitCheck(REAL, every=1, window=3), np.zeros((160, 120, 3), np.float32)
    tint[:70, :50] = 20
    show(check, lit(bump(110, 80)) + noise + tint, bump(110, 80), frames=3)
    assert "off by 20 grey levels far from all that touches" in check.problem
    assert far_change(lit(bump()) + noise, bump(), REAL.pixel_size) < 1
    assert far_change(lit(bump(radius=200)) + noise, bump(radius=200), REAL.pixel_size) == 0
