"""Soft gel: shape of an elastic layer on a window into which a stiff object is pressed.

The layer is bonded to a rigid base and touched without friction (Johnson, Contact Mechanics, 1985, chapter 5). Its
displacement is the convolution of the pressure with one function of position, a product in the Fourier domain (Stanley
and Kato 1997). The pressure is nowhere negative and leaves no part of the object inside the gel; it is found by
conjugate gradients (Polonsky and Keer 1999). On a thick layer this is Hertz' contact.

This model judges the error of the simple rule of `rendering/renderer.py`; it is not used for training.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from midastouch_common.errors import InputError

POISSON = 0.48
"""Poisson's ratio of silicone, nearly incompressible."""
_CLEAR = 2.0  # thicknesses of margin around the image, beyond which pressure has no effect
_EXACT = 2e-6  # m, RMS distance allowed between gel and object where the gel bears it
_MOST_STEPS = 200


class ElasticLayer:
    """Flat elastic layer of `thickness` m, seen in images of `shape` (rows, columns) with pixels of `pixel` m."""

    def __init__(self, shape: tuple[int, int], pixel: float, thickness: float, poisson: float = POISSON):
        self._shape = shape
        room = int(np.ceil(_CLEAR * thickness / pixel))
        self._full = tuple(fft.next_fast_len(size + room, real=True) for size in shape)
        waves = np.hypot(fft.fftfreq(self._full[0], pixel)[:, None], fft.rfftfreq(self._full[1], pixel))
        q = np.maximum(2 * np.pi * waves * thickness, 1e-3)  # below that the compliance is constant
        # hyperbolic functions of 2 q over exp(2 q), which would overflow
        a, e = 3 - 4 * poisson, np.exp(-2 * q)
        raised = a * (1 - e * e) / 2 - 2 * q * e
        resisted = a * (1 + e * e) / 2 + (2 * q * q + 5 - 12 * poisson + 8 * poisson**2) * e
        self._compliance = (2 * thickness / q * raised / resisted).astype(np.float32)

    def pressed(self, penetration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the gel's height (H, W) float32 m over its rest, and the pixels (H, W) bool where it bears the object.

        penetration (H, W) m of the object in the untouched gel, negative where the object is above it, because
        displaced gel bulges out around a contact and may touch there. Raises InputError if no solution is found.
        """
        goal = np.asarray(penetration, np.float32)
        pressure = np.maximum(goal, 0) / self._compliance.mean()
        direction, turn, before = np.zeros_like(goal), 0.0, 1.0
        for _ in range(_MOST_STEPS):
            beyond = self._height(pressure) - goal
            bears = pressure > 0
            squares = float(np.square(beyond[bears]).sum())
            pressed_in = ~bears & (beyond < 0)
            if squares <= _EXACT**2 * bears.sum() and not (beyond[pressed_in] < -_EXACT).any():
                return beyond + goal, bears
            direction = np.where(bears, turn * squares / before * direction - beyond, 0)
            answer = self._height(direction)
            step = -float(beyond[bears] @ direction[bears]) / float(answer[bears] @ direction[bears])
            pressure = np.maximum(pressure + step * direction, 0)
            pressed_in &= pressure == 0
            pressure[pressed_in] = -step * beyond[pressed_in]
            turn, before = float(not pressed_in.any()), squares
        raise InputError(f"no contact of a gel with an object {1e3 * goal.max():.2g} mm deep in it is found")

    def _height(self, pressure: np.ndarray) -> np.ndarray:
        """Return the displacement (H, W) float32 m by pressures (H, W), in units of E / (1 - nu^2) of the gel."""
        rows, columns = self._shape
        return fft.irfft2(fft.rfft2(pressure, self._full) * self._compliance, self._full)[:rows, :columns]
