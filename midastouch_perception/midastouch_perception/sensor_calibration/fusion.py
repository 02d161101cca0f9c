"""Choice of how a sensor's slopes are joined with the depth network's, from presses of a ball it is calibrated with.

On some gels the colours are nearer to the truth than the network, on others the network is, and outlines are seen wider
or narrower than they are. So both belong to the sensor. They are chosen by presses that the calibration has not seen:
by the errors of depth, deepest point and radius together, because each alone can be bought by the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..sensor_model import SensorModel
from ..tdn.inference import load_tdn
from ..tdn.slope_fusion import joined_depth
from .calibration import NETWORK_WEIGHT, OUTLINE_GROWTH, Fusion, SensorCalibration, plain_slopes
from .network_checks import CORE, curvature

DEFAULT = Fusion(NETWORK_WEIGHT, OUTLINE_GROWTH)
CHOICES = [Fusion(weight, growth) for weight in (0.0, 0.25, NETWORK_WEIGHT, 0.75, 1.0) for growth in range(3)]
_DRAWS = 200  # of the bootstrap
_FLAT = -2.0  # logarithm of a curvature relative to the true one, where none is measured


def fusion_errors(
    images: Sequence[np.ndarray],
    penetrations: Sequence[np.ndarray | None],
    held_out: Sequence[SensorCalibration | None],
    background: np.ndarray,
    sensor: SensorModel,
) -> dict[Fusion, np.ndarray]:
    """Return the errors (N, 3) of the N used presses for each choice.

    Their columns: root mean square error of depth, relative to the press's own root mean square; logarithms of the
    core's curvature and of the deepest point, both relative to the true ones. Arguments as for `depth_errors`.
    """
    errors: dict[Fusion, list[tuple[float, float, float]]] = {choice: [] for choice in CHOICES}
    tdn = load_tdn("fast", sensor)
    pixel = tdn.sensor.pixel_size
    for image, penetration, calibration in zip(images, penetrations, held_out, strict=True):
        if calibration is None:
            continue
        tdn.calibration = calibration
        difference = tdn.difference(image, background)
        slopes, by_network = plain_slopes(difference), tdn.network_penetration(difference)  # type: ignore[attr-defined] # "fast" is our own
        true = np.maximum(penetration, 0)
        for choice in CHOICES:
            errors[choice].append(_errors(joined_depth(slopes, by_network, pixel, choice), true, pixel))
    return {choice: np.array(rows) for choice, rows in errors.items()}


def chosen_fusion(errors: Mapping[Fusion, np.ndarray]) -> Fusion:
    """Return the choice nearest to the default among those that are not worse than the best by a standard error.

    So presses that say little, or contradict each other, leave the default. errors (N, 3), of `fusion_errors`. The
    standard error is that of the difference from the best, by a bootstrap over the presses.
    """
    presses = len(errors[DEFAULT])
    draws = np.random.default_rng(0).integers(presses, size=(_DRAWS, presses))
    loss = {choice: _loss(values) for choice, values in errors.items()}
    drawn = {choice: _loss(values[draws]) for choice, values in errors.items()}
    best = min(CHOICES, key=lambda choice: loss[choice])
    as_good = [each for each in CHOICES if loss[each] - loss[best] <= np.std(drawn[each] - drawn[best])]
    # a step of weight is a quarter, one of growth a pixel
    return min(as_good, key=lambda each: 4 * abs(each.weight - DEFAULT.weight) + abs(each.growth - DEFAULT.growth))


def _errors(measured: np.ndarray, true: np.ndarray, pixel: float) -> tuple[float, float, float]:
    either = (true > 0) | (measured > 0)
    off = np.sqrt(((measured - true)[either] ** 2).mean() / (true[true > 0] ** 2).mean())
    wanted, found = curvature(true, pixel, CORE), curvature(measured, pixel, CORE)
    bent = 0.0 if wanted is None else _FLAT if found is None or found <= 0 else np.log(found / wanted)
    deep = np.log(max(measured.max(), np.exp(_FLAT) * true.max()) / true.max())
    return float(off), float(max(bent, _FLAT)), float(deep)


def _loss(errors: np.ndarray) -> np.ndarray:
    """Return the lengths (...) of the vectors of median errors (..., N, 3)."""
    return np.linalg.norm(np.median(errors, axis=-2), axis=-1)
