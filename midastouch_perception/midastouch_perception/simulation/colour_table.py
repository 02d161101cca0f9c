"""Optics fitted on a real DIGIT: the colour table of the Taxim simulator (Si and Yuan, RA-L 2022).

Per bin of slope and direction, a quadratic in the pixel's position gives the change of each colour. Real gel answers
several times stronger than TACTO's, saturates with slope, and differs over the image.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError
from midastouch_common.files import require_file

_LIMIT = 130.0  # grey levels: the quadratics overshoot where no press of the fit has been


class ColourTable:
    """Slope of the gel to change of colour, at any resolution of the portrait image.

    Args: coefficients (S, D, 6, 3): per slope bin (0 ... 90 deg), direction bin (-180 ... 180 deg) and channel the
    factors of x^2, y^2, xy, x, y, 1 in pixels of a 640 x 480 image.
    """

    def __init__(self, coefficients: np.ndarray):
        if coefficients.ndim != 4 or coefficients.shape[2:] != (6, 3) or not np.isfinite(coefficients).all():
            raise InputError(f"colour table: shape {coefficients.shape}, need finite (slopes, directions, 6, 3)")
        # the fit leaves an offset on flat gel, which a difference image cannot have
        flat = coefficients[0].mean(axis=0)
        self._coefficients = np.ascontiguousarray(coefficients - flat, np.float32)

    @classmethod
    def load(cls, path: str | Path) -> ColourTable:
        """From Taxim's `polycalib.npz` (arrays grad_r, grad_g, grad_b). Raises InputError if it is not one."""
        path = require_file(path, "colour table")
        try:
            with np.load(path, allow_pickle=False) as file:
                return cls(np.stack([file[f"grad_{c}"] for c in "rgb"], axis=-1))
        except Exception as error:  # NumPy, zipfile and zlib raise a different type for each way a file can be broken
            raise InputError(f"{path}: not a Taxim colour table ({error}); give its polycalib.npz") from error

    def difference(self, relief: np.ndarray, pixel: float, quarter_turns: int = 0, mirrored: bool = False):
        """Change (H, W, 3) float32, grey levels, of the image by a gel surface raised by `relief` (H, W) m.

        pixel: m per pixel. quarter_turns, mirrored: how the table's camera image maps to this portrait image; the
        table's own orientation (one quarter turn) is not documented with it.
        """
        down, right = np.gradient(np.ascontiguousarray(relief, np.float32), np.float32(pixel))
        out = kernels.look_up_colours(self._coefficients, down, right, quarter_turns % 4, mirrored)
        return np.clip(out, -_LIMIT, _LIMIT, out=out)
