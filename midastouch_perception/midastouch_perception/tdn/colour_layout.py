"""Layout of colours on a DIGIT's untouched gel, lit red from the left, green from the right, blue from below.

The input of the depth network is the difference from the no-contact image, which does not show that a driver publishes
images that are turned, mirrored, or have red and blue swapped. The layout of colours in the no-contact image does. It
is compared with the mean layout of 24 DIGITs (`no_contact_layout.npz`, made by this module).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.files import atomic_path
from midastouch_common.images import image_files, read_image_file

_FILE = Path(__file__).parent / "no_contact_layout.npz"
_GRID = (16, 12)  # rows, columns
_MARGIN = 0.15  # of correlation by which another orientation must match better to be reported
_MARGIN_OF_TWO = 0.4  # the same for two mistakes at once, because some sensors are lit like that
_LEAST_CORRELATION = 0.2  # below it no layout is recognised: some DIGITs are lit in another way
_SAME_SENSOR = 0.8  # least correlation of an image with its sensor's no-contact image, under any touch
_DARK, _BRIGHT = 12.0, 250.0  # grey levels
_MOST_CLIPPED = 0.05

_SWAP = "with red and blue swapped"
_TURNS = {
    "upside down": lambda image: image[::-1, ::-1],
    "mirrored left to right": lambda image: image[:, ::-1],
    "mirrored top to bottom": lambda image: image[::-1],
}
_SWAPPED_AND_TURNED = {
    f"{name} and {_SWAP}": lambda image, turn=turn: turn(image)[..., ::-1] for name, turn in _TURNS.items()
}

ORIENTATIONS = {**_TURNS, _SWAP: lambda image: image[..., ::-1], **_SWAPPED_AND_TURNED}
"""Possible mistakes in an image (H, W, 3), each with a function that undoes it (and also makes it)."""


def colour_layout(image: np.ndarray) -> np.ndarray:
    """Return the layout of colours in an image (H, W, 3) RGB: chromaticities (16, 12, 3), mean 0, norm 1; 0 if grey."""
    small = cv2.resize(np.ascontiguousarray(image, np.float32), _GRID[::-1], interpolation=cv2.INTER_AREA)
    chromaticity = small / np.maximum(small.sum(axis=2, keepdims=True), 1e-3)
    chromaticity -= chromaticity.mean(axis=(0, 1))
    norm = np.linalg.norm(chromaticity)
    return chromaticity / norm if norm > 1e-3 else np.zeros_like(chromaticity)


def mean_layout(images: Iterable[np.ndarray]) -> np.ndarray:
    """Return the mean layout (16, 12, 3), of unit norm, of many sensors' no-contact images (H, W, 3)."""
    mean = np.mean([colour_layout(image) for image in images], axis=0)
    return mean / np.linalg.norm(mean)


def shipped_layout() -> np.ndarray:
    """Return the mean layout (16, 12, 3) that comes with the networks."""
    with np.load(_FILE, allow_pickle=False) as file:
        return file["layout"]


def exposure_problem(image: np.ndarray, most: float) -> str:
    """Return the problem and its fix if an image is too dark or too bright; empty if it is not.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB
    most : fraction of the image that may be saturated, 0 ... 1
    """
    if image.mean() < _DARK:
        return "black; check the sensor's lights and its cable"
    clipped = float((image >= _BRIGHT).any(axis=2).mean())
    if clipped > most:
        return f"saturated ({100 * clipped:.0f} % of it); dim the sensor's lights (driver: intensity)"
    return ""


def image_problem(image: np.ndarray, layout: np.ndarray | None) -> str:
    """Return the problem with a no-contact image and its fix; empty if there is none.

    Parameters
    ----------
    image : (H, W, 3) uint8 RGB
    layout : (16, 12, 3)
        Colour layout of correct images of DIGITs; None for a sensor with unknown lamps.
    """
    if problem := exposure_problem(image, _MOST_CLIPPED):
        return f"the no-contact image is {problem}"
    if layout is not None and (wrong := misorientation(image, layout)):
        return f"the images look {wrong}; {driver_fix(wrong)}"
    return ""


def misorientation(image: np.ndarray, layout: np.ndarray, least: float = _LEAST_CORRELATION) -> str:
    """Return the one of `ORIENTATIONS` that an image (H, W, 3) uint8 RGB looks like; empty if it looks upright.

    layout: (16, 12, 3), of correct images. least: correlation below which no orientation is recognised.
    """
    found = colour_layout(image)
    upright = float((found * layout).sum())
    fits = {name: float((found * undo(layout)).sum()) for name, undo in ORIENTATIONS.items()}
    best = max(fits, key=fits.get)
    margin = _MARGIN_OF_TWO if best in _SWAPPED_AND_TURNED else _MARGIN
    return best if fits[best] > max(upright + margin, least) else ""


def turned_since(image: np.ndarray, background: np.ndarray) -> str:
    """Return the problem and its fix if an image is turned or swapped against its own no-contact image; empty if not.

    A touch changes the layout of colours far less than any of `ORIENTATIONS`, or another sensor, does.

    Parameters
    ----------
    image, background : (H, W, 3) uint8 RGB
    """
    if wrong := misorientation(image, colour_layout(background), _SAME_SENSOR):
        return (
            f"the images look {wrong} against the no-contact image; {driver_fix(wrong)}, or if that is wanted lift "
            "the finger and call capture_background"
        )
    return ""


def driver_fix(wrong: str) -> str:
    """Return what to do about one of `ORIENTATIONS`."""
    settings = [name for name, seen in (("rotation", wrong != _SWAP), ("encoding", _SWAP in wrong)) if seen]
    return f"check the driver's {' and '.join(settings)}"


def main() -> None:
    """Write the mean layout of the no-contact images in a folder, the one argument, next to this file."""
    folder = Path(sys.argv[1])
    images = [read_image_file(p)[:, :, ::-1] for p in image_files(folder)]
    with atomic_path(_FILE) as path:
        np.savez_compressed(path, layout=mean_layout(images).astype(np.float32), images=len(images))
    print(f"{_FILE}: {len(images)} images")


if __name__ == "__main__":
    main()
