"""The DIGIT's three LEDs: four bits each, packed into one camera control."""

from __future__ import annotations

from midastouch_common.errors import InputError

MAX_LEVEL = 15


def scaled_levels(intensity: int, rgb: list[int]) -> tuple[int, int, int]:
    """LED levels 0...15 for an overall ``intensity`` (0...15) of the colour ``rgb`` (0...15 each).

    Raises:
        InputError: a value is out of range or there are not three of them.
    """
    if len(rgb) != 3 or any(not 0 <= level <= MAX_LEVEL for level in rgb):
        raise InputError(f"intensity_rgb: needs three levels in 0...{MAX_LEVEL} (red, green, blue), got {list(rgb)}")
    if not 0 <= intensity <= MAX_LEVEL:
        raise InputError(f"intensity: must be in 0...{MAX_LEVEL}, got {intensity}")
    red, green, blue = (round(level * intensity / MAX_LEVEL) for level in rgb)
    return red, green, blue


def packed(rgb: tuple[int, int, int]) -> int:
    """The value of the control (``V4L2_CID_ZOOM_ABSOLUTE``, which the DIGIT's firmware uses for its LEDs)."""
    red, green, blue = rgb
    return red << 8 | green << 4 | blue
