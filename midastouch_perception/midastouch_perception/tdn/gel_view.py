"""View of the gel in a no-contact image: gels with printed markers, and a border around the gel."""

from __future__ import annotations

import cv2
import numpy as np

_SMOOTHING = 5  # px, against noise
_CORNER = 48  # px along the diagonal from each corner
_RIM = 10  # px along the diagonal in which a border ends
_DARKER = 0.7  # brightness over that further in: of 24 DIGITs' no-contact images 0.77 or more in all corners but one
_DARK_CORNERS = 2  # a lamp may shine into the others

_WIDEST_DOT = 25  # px
_DEEPEST, _SPREADS = 8.0, 6.0  # grey levels below the gel around a dot, and robust standard deviations of that
_DOT_PIXELS = 8, 500  # area of a dot
_FEWEST_DOTS = 12
_LIKE = 0.3  # by which distances and areas of markers differ at most from the median
_REGULAR = 0.5  # of the dots must be alike; of dust few are


def view_problem(background: np.ndarray) -> str:
    """Return the problem with what a no-contact image (H, W, 3) uint8 RGB shows, and its fix; empty without."""
    grey = cv2.blur(background.mean(axis=2, dtype=np.float32), (_SMOOTHING, _SMOOTHING))
    if number := markers(grey):
        return (
            f"the gel has markers ({number} dark dots in a regular pattern), which move with every touch and are read "
            "as depth: use a gel without markers"
        )
    if dark_corners(grey) >= _DARK_CORNERS:
        return (
            "the image shows a dark border around the gel, which is no gel to read: set `crop` in the driver's camera "
            "model so that only gel is in view, and focal in the sensor model accordingly"
        )
    return ""


def dark_corners(grey: np.ndarray) -> int:
    """Return the number (0 ... 4) of corners of a grey image (H, W) that a dark border fills."""
    steps = np.arange(_CORNER)
    found = 0
    for corner in (grey, grey[:, ::-1], grey[::-1], grey[::-1, ::-1]):
        diagonal = corner[steps, steps]
        so_far = np.maximum.accumulate(diagonal)  # dark up to the corner itself, other than a speck
        found += bool((so_far[:-_RIM] < _DARKER * diagonal[_RIM:]).any())
    return found


def markers(grey: np.ndarray) -> int:
    """Return the number of markers in a grey image (H, W): dark dots of like size at like distances; 0 if they are few
    or irregular."""
    around = cv2.morphologyEx(grey, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_WIDEST_DOT,) * 2))
    depth = around - grey
    spread = 1.48 * float(np.median(np.abs(depth - np.median(depth))))
    dots = (depth > max(_DEEPEST, float(np.median(depth)) + _SPREADS * spread)).astype(np.uint8)
    _, _, stats, centres = cv2.connectedComponentsWithStats(dots)
    areas = stats[1:, cv2.CC_STAT_AREA]
    kept = (areas >= _DOT_PIXELS[0]) & (areas <= _DOT_PIXELS[1])
    if kept.sum() < _FEWEST_DOTS:
        return 0
    centres, areas = centres[1:][kept], areas[kept]
    apart = np.hypot(*np.moveaxis(centres[:, None] - centres, -1, 0))
    nearest = np.sort(apart, axis=1)[:, 1]
    alike = (np.abs(nearest / np.median(nearest) - 1) < _LIKE) & (np.abs(areas / np.median(areas) - 1) < 2 * _LIKE)
    return int(kept.sum()) if alike.mean() >= _REGULAR else 0
