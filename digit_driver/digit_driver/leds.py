"""The DIGIT's three LEDs: four bits each, packed into one camera control."""

from __future__ import annotations

MAX_LEVEL = 15


def scaled_levels(intensity: int, rgb: list[int]) -> tuple[int, int, int]:
    """LED levels 0...15 for an overall ``intensity`` (0...15) of the colour ``rgb`` (three levels of 0...15)."""
    red, green, blue = (round(level * intensity / MAX_LEVEL) for level in rgb)
    return red, green, blue


def packed(rgb: tuple[int, int, int]) -> int:
    """The value of the control (``V4L2_CID_ZOOM_ABSOLUTE``, which the DIGIT's firmware uses for its LEDs)."""
    red, green, blue = rgb
    return red << 8 | green << 4 | blue
