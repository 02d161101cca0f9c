"""Scale bars of pictures: a line of a round length, labelled with that length."""

from __future__ import annotations

import numpy as np
from matplotlib.patheffects import withStroke

from .canvas import Camera

_STEPS = np.outer(10.0 ** np.arange(-4, 2), (1, 2, 5)).ravel()  # m
_PART = 0.2  # of the extent of the picture
INK = "#4a5260"


def round_length(extent: float) -> tuple[float, str]:
    """Return about a fifth of an extent [m], rounded to 1, 2 or 5 times a power of ten [m], and its label."""
    wanted = max(_PART * extent, _STEPS[0])
    length = float(_STEPS[np.argmin(np.abs(np.log(_STEPS / wanted)))])
    return length, f"{1e3 * length:g} mm"


def draw_scale(axes, camera: Camera) -> None:
    """Draw a scale bar in the lower left corner of axes that show a picture by `camera`."""
    length, words = round_length(camera.width * camera.pixel_size)
    pixels = length / camera.pixel_size
    left, row = 0.03 * camera.width, 0.95 * camera.height
    halo = [withStroke(linewidth=3, foreground="white")]  # it may lie on the object
    axes.plot([left, left + pixels], [row, row], color=INK, lw=2, solid_capstyle="butt", path_effects=halo)
    middle, above = left + pixels / 2, row - 0.01 * camera.height
    axes.text(middle, above, words, color=INK, fontsize=8, ha="center", va="bottom", path_effects=halo)
