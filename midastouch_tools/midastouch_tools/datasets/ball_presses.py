"""A folder of presses of one ball on one sensor: images, the no-contact image, labelled contact circles."""

from __future__ import annotations

import csv
import dataclasses
import math
import os
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import require_folder
from midastouch_common.images import image_files
from midastouch_perception.tdn import estimate_background

from .sequence import read_image

BACKGROUND, CIRCLES = "background.png", "circles.csv"
LABELS, IMAGES, OUTLINE = "labels", "images", "felt outline"
"""Sources of the position of a press."""
_COLUMNS = ("frame", "center_x_px", "center_y_px", "radius_px")
_LABEL_RADII = 3, 320  # px of a label: less is a slip of the mouse, more is wider than the image
_SHADOW_RADIUS_RATIO = 1.7  # of the radius of a contact: the gel around it is still bent and casts a shadow
_VISIBLE_CHANGE = 15.0  # grey levels: a change the eye sees too
_LARGEST_FILLED_FRACTION = 0.02  # of the image: as much as this may be filled in from its surroundings

Circle = tuple[float, float, float]
"""Column and row of the centre, radius [px]."""


@dataclasses.dataclass(frozen=True)
class BallPresses:
    """Presses of one ball. images (320, 240, 3) uint8 RGB: by file name, without repeated ones; background (320, 240,
    3) uint8 RGB; circles: contact of every image by file name, None without labels; circles_from: source of the
    circles, `LABELS` or `IMAGES` (some images may then have none); repeated: files with the image of another file.
    """

    images: dict[str, np.ndarray]
    background: np.ndarray
    circles: dict[str, Circle] | None
    circles_from: str = LABELS
    repeated: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def truth(self) -> str:
        """Source of the position of a press: `LABELS`, `IMAGES`, or its measured `OUTLINE` if there are no circles."""
        return OUTLINE if self.circles is None else self.circles_from

    def only(self, names: list[str]) -> BallPresses:
        """Return the presses of these names, with the background of all presses."""
        circles = self.circles and {name: self.circles[name] for name in names if name in self.circles}
        return dataclasses.replace(self, images={name: self.images[name] for name in names}, circles=circles)


def load_ball_presses(folder: str | Path) -> BallPresses:
    """Read PNG and JPEG images, `background.png` and `circles.csv` of a folder.

    Without `background.png`, the background is the median over the presses with their contacts masked out. Raises
    InputError for a folder without presses, unreadable images, and labels that do not fit the images.
    """
    folder = Path(folder)
    every, background = read_presses(folder)
    images, repeated = {}, {}
    seen: dict[bytes, str] = {}
    for name, image in every.items():
        first = seen.setdefault(image.tobytes(), name)
        if first == name:
            images[name] = image
        else:
            repeated[name] = first
    circles = _read_circles(folder / CIRCLES, images, set(every))
    if background is None:
        contacts = _labelled(images, circles) if circles else _visible(images)
        background = _masked_median(folder, images, contacts)
    return BallPresses(images, background, circles, repeated=repeated)


def read_presses(folder: Path) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """Return the images of a folder by file name, and the no-contact image or None.

    Raises InputError if there is no such folder, no image (PNG or JPEG) except `background.png`, an unreadable image,
    or a no-contact image of another name.
    """
    paths = image_files(require_folder(folder, "of images of presses"))
    for path in paths:
        if path.stem.lower() == Path(BACKGROUND).stem and path.name != BACKGROUND:
            raise InputError(f"{path}: save the no-contact image as {BACKGROUND} (PNG, as JPEG changes colours)")
    images = {path.name: read_image(path) for path in paths}
    background = images.pop(BACKGROUND, None)
    if not images:
        raise InputError(f"{folder}: no images (PNG or JPEG) of presses in it")
    return images, background


def _read_circles(file: Path, images: dict[str, np.ndarray], known: set[str]) -> dict[str, Circle] | None:
    if not os.path.lexists(file):
        return None
    if not file.is_file():
        raise InputError(f"{file}: not a file; write the labels there, or remove it to use none")
    try:
        circles = _parse_circles(file, {Path(name).stem: name for name in known})
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: not a CSV table ({error}); save it as CSV in UTF-8") from error
    for name, image in images.items():
        if name not in circles:
            raise InputError(f"{file}: no circle of {name}; label every press, or remove the file to use none")
        column, row, radius = circles[name]
        height, width = image.shape[:2]
        if math.hypot(max(-column, 0, column - width), max(-row, 0, row - height)) >= radius:
            raise InputError(f"{file}: circle of {name} lies outside the image of {width} x {height}; label it again")
    return {name: circles[name] for name in images}


def _parse_circles(file: Path, names: dict[str, str]) -> dict[str, Circle]:
    """Return circles by file name. The table names images without their ending; `names`: file names by that."""
    circles: dict[str, Circle] = {}
    with file.open(newline="", encoding="utf-8-sig") as lines:  # spreadsheets write a byte-order mark
        reader = csv.DictReader(lines)
        missing = [column for column in _COLUMNS if column not in (reader.fieldnames or ())]
        if missing:
            raise InputError(f"{file}: no column {', '.join(missing)}; need {','.join(_COLUMNS)}")
        for row in reader:
            circle = _circle(row)
            if circle is None:
                raise InputError(
                    f"{file}, line {reader.line_num}: not a circle: a frame and three numbers, the radius from "
                    f"{_LABEL_RADII[0]} to {_LABEL_RADII[1]} px"
                )
            name = names.get(Path(row["frame"]).stem)
            if name is None:
                raise InputError(f"{file}, line {reader.line_num}: no image of frame {row['frame']}; remove the line")
            # labelling a frame again appends a line: the last one counts
            circles[name] = circle
    return circles


def _circle(row: dict) -> Circle | None:
    try:
        column, line, radius = (float(row[key]) for key in _COLUMNS[1:])
    except (TypeError, ValueError):
        return None
    known = row["frame"] and np.isfinite([column, line]).all() and _LABEL_RADII[0] <= radius <= _LABEL_RADII[1]
    return (column, line, radius) if known else None


def _labelled(images: dict[str, np.ndarray], circles: dict[str, Circle]) -> list[np.ndarray]:
    contacts = []
    for name, image in images.items():
        column, row, radius = circles[name]
        rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
        contacts.append(np.hypot(columns - column, rows - row) < _SHADOW_RADIUS_RATIO * radius)
    return contacts


def _visible(images: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Mask each image where it differs from the plain median, which may still show contacts if presses are many."""
    median = estimate_background(list(images.values())).astype(np.float32)
    contacts = []
    for image in images.values():
        change = np.abs(cv2.GaussianBlur(image - median, (0, 0), 3)).max(axis=2) > _VISIBLE_CHANGE
        contacts.append(cv2.dilate(change.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=10) > 0)
    return contacts


def _masked_median(folder: Path, images: dict[str, np.ndarray], contacts: list[np.ndarray]) -> np.ndarray:
    """The no-contact image (H, W, 3) uint8: each pixel's median over the images whose contact leaves it free."""
    stack = np.ma.array(np.stack(list(images.values())))
    stack.mask = np.broadcast_to(np.stack(contacts)[..., None], stack.shape)
    median = np.ma.median(stack, axis=0)
    never = np.ma.getmaskarray(median).max(axis=2)
    if never.mean() > _LARGEST_FILLED_FRACTION:
        raise InputError(
            f"{folder}: {100 * never.mean():.0f} % of the gel is pressed in every image, so the no-contact image "
            f"cannot be estimated from them; put one there as {BACKGROUND}"
        )
    return cv2.inpaint(np.rint(median.filled(0)).astype(np.uint8), never.astype(np.uint8), 3, cv2.INPAINT_TELEA)
