"""The sensor's no-contact image from files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError

from .background import MOST_DOUBTFUL, doubtful_share, estimate_background

_MOST_FILES = 200


def read_background(path: str | Path, height: int, width: int) -> np.ndarray:
    """RGB image (height, width, 3) uint8 from an image file, or estimated from a folder of a sensor's images.

    Raises InputError: no such path, no images in it, not an image, another size, or images that show contacts at the
    same place too often to tell what is behind them.
    """
    path = Path(path)
    if not path.is_dir():
        return _read_image(path, height, width)
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in (".png", ".jpg", ".jpeg"))
    if not files:
        raise InputError(f"{path}: no PNG or JPEG images in this folder to estimate a background from")
    chosen = files[:: -(-len(files) // _MOST_FILES)]
    images = [_read_image(file, height, width) for file in chosen]
    background = estimate_background(images)
    doubt = doubtful_share(images, background)
    if doubt > MOST_DOUBTFUL:
        raise InputError(
            f"{path}: {100 * doubt:.0f} % of the image is touched in most of these images; "
            "give images without contact, or a slide with longer pauses"
        )
    return background


def _read_image(path: Path, height: int, width: int) -> np.ndarray:
    if not path.is_file():
        raise InputError(f"{path}: no such background image; leave the parameter empty to estimate one")
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: not an image; use PNG or JPEG")
    if image.shape[:2] != (height, width):
        raise InputError(f"{path}: {image.shape[1]} x {image.shape[0]} pixels, the sensor model has {width} x {height}")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
