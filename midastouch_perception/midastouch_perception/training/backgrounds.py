"""Real no-contact images of many DIGITs, for training."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError

HELD_OUT = 4  # the last ones by name only validate


def load_backgrounds(folder: str | Path, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Training and validation images (B, height, width, 3) uint8 RGB from the JPEG or PNG files of `folder`.

    Raises InputError if there are fewer than 8 readable ones.
    """
    paths = [p for p in sorted(Path(folder).glob("*")) if p.suffix.lower() in (".jpg", ".png")]
    images = [cv2.imread(str(path)) for path in paths]
    images = [cv2.resize(i, (width, height), interpolation=cv2.INTER_AREA)[:, :, ::-1] for i in images if i is not None]
    if len(images) < 8:
        raise InputError(f"{folder}: {len(images)} readable no-contact images; training needs at least 8")
    return np.stack(images[:-HELD_OUT]), np.stack(images[-HELD_OUT:])
