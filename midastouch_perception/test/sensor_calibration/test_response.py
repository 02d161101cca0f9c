import numpy as np
import pytest

from midastouch_perception.sensor_calibration import response
from midastouch_perception.sensor_calibration.response import (
    ColourResponse,
    NormalEquations,
    height_slopes,
    press_equations,
    well_inside,
)

SIZE = 80, 60
ROWS = np.linspace(-1, 1, SIZE[0])[:, None]
LEVELS = 60.0  # grey levels of a slope of 1
LAMPS = np.float32([[1, -0.5, -0.5], [0, 0.87, -0.87]])
STEEPEST = 0.7


def press(rng, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Colours and slopes (H, W, 3), (H, W, 2) of random shapes; noise, grey levels, more of it further down."""
    slopes = rng.normal(0, 0.4, (*SIZE, 2)).astype(np.float32)
    colours = LEVELS * slopes @ LAMPS
    uneven = noise * np.exp(ROWS[..., None]) * rng.standard_normal(colours.shape)
    return (colours + uneven).astype(np.float32), slopes


def steepness(slopes, truth, rows) -> float:
    return float((slopes * truth)[rows].sum() / (truth[rows] ** 2).sum())


@pytest.mark.parametrize("noise", [1.0, 12.0])
def test_slopes_are_as_steep_as_true_however_noisy_the_colours(noise):
    rng, equations = np.random.default_rng(0), NormalEquations()
    for _ in range(10):
        equations += NormalEquations.of(*press(rng, noise), np.ones(SIZE, np.float32))
    colours, truth = press(rng, noise)
    slopes = ColourResponse(equations.solve()).slopes(colours)
    for rows in (slice(0, 20), slice(30, 50), slice(60, 80)):
        assert steepness(slopes, truth, rows) == pytest.approx(1, abs=0.05)


def test_few_presses_in_one_place_say_little_of_others():
    rng = np.random.default_rng(1)
    colours, slopes = press(rng, 3.0)
    weight = np.zeros(SIZE, np.float32)
    weight[:25] = 1
    response = ColourResponse(NormalEquations.of(colours, slopes, weight).solve())
    assert 0.4 < steepness(response.slopes(colours), slopes, slice(60, 80)) < 1.6


def test_a_glint_is_no_wall():
    """Colours far beyond those of the presses: the polynomial alone would make slopes of hundreds of them."""
    rng, equations = np.random.default_rng(0), NormalEquations()
    for _ in range(5):
        equations += NormalEquations.of(*press(rng, 12.0), np.ones(SIZE, np.float32))
    colours, truth = press(rng, 0.0)
    colours[20:24, 20:24] = 250.0
    slopes = np.linalg.norm(ColourResponse(equations.solve()).slopes(colours), axis=-1)
    assert slopes.max() <= response.STEEPEST * (1 + 1e-6)
    gentle = np.linalg.norm(truth, axis=-1) < 1
    gentle[20:24, 20:24] = False
    np.testing.assert_allclose(slopes[gentle], np.linalg.norm(truth, axis=-1)[gentle], atol=0.3)


def shaded_press(u: float, radius: float, shade: float, pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Change (H, W, 3) and penetration (H, W) m of a ball pressed at column u in a circle of `radius` px; beside it a
    lobe that is coloured as a slope of `shade`."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    squared = (columns - u) ** 2 + (rows - SIZE[0] / 2) ** 2
    penetration = ((radius**2 - squared) * pixel * STEEPEST / (2 * radius)).astype(np.float32)
    change = LEVELS * height_slopes(np.maximum(penetration, 0), pixel) @ LAMPS
    lobe = (squared > (1.3 * radius) ** 2) & (squared < (2.2 * radius) ** 2) & (columns > u)
    change[lobe] = LEVELS * np.float32([shade, 0]) @ LAMPS
    return change, penetration


def test_slopes_are_as_steep_as_the_ball_whatever_the_shadows():
    pixel, equations = 1e-4, NormalEquations()
    for u in (15, 25, 35, 45):
        equations += press_equations(*shaded_press(u, 7, -0.5, pixel), pixel)
    response = ColourResponse(equations.solve())
    for u in (20, 40):
        change, penetration = shaded_press(u, 7, -0.5, pixel)
        dark = well_inside(penetration) & (np.arange(SIZE[1]) > u)  # where slopes are coloured as the lobe is
        truth = height_slopes(np.maximum(penetration, 0), pixel)[dark]
        assert steepness(response.slopes(change)[dark], truth, slice(None)) == pytest.approx(1, abs=0.07)
