"""Guide through the presses of a ball: which were taken, which were refused and why, and where to press next."""

from __future__ import annotations

import collections

import numpy as np

from ..sensor_model import SensorModel
from ..tdn.colour_layout import exposure_problem
from ..tdn.inputs import ContactLight, check_image, coarse, reduce_image, without_drift
from .ball import BallContact
from .presses import MOST_SPOILED, look_at

_BLOCK = 8  # px
_TOUCH_LEVEL = 8.0  # grey levels of a block, from which an object touches
_RELEASE_LEVEL = 5.0  # grey levels of a block, below which a touch has ended
_STILL_IMAGES = 5  # images that must be alike
_STILL_LEVEL = 2.5  # grey levels of a block between them
_LONG_HOLD = 300  # still images after the verdict on a press: 5 to 10 s
_LEAST_DISTANCE = 1e-3  # m; contacts closer than this are the same
REGIONS = (
    *(f"top {column}" for column in ("left", "centre", "right")),
    *("middle left", "centre", "middle right"),
    *(f"bottom {column}" for column in ("left", "centre", "right")),
)
"""Names of the ninths of the image, row by row."""


class PressCollector:
    """Collector of one image of each usable press that is held still; the ball must be lifted in between.

    Attributes: images (320, 240, 3) uint8 RGB by name, those taken; refusals, reasons why others were not.

    Parameters
    ----------
    background : (320, 240, 3) uint8 RGB
    ball_diameter : [m]
    sensor
        Full size.
    wanted
        Number of presses.
    """

    def __init__(self, background: np.ndarray, ball_diameter: float, sensor: SensorModel, wanted: int = 10):
        self._light = ContactLight(reduce_image(check_image(background, sensor, "background")), sensor.light)
        self._radius, self._sensor, self._half = 0.5 * ball_diameter, sensor, sensor.for_maps
        self._wanted = wanted
        self._recent: collections.deque[np.ndarray] = collections.deque(maxlen=_STILL_IMAGES)
        self._contacts: list[BallContact] = []
        self._judged = False  # has the present press had its verdict?
        self._held = 0  # number of still images since then
        self.images: dict[str, np.ndarray] = {}
        self.refusals: list[str] = []

    @property
    def done(self) -> bool:
        """True once enough presses were taken."""
        return len(self.images) >= self._wanted

    @property
    def next_step(self) -> str:
        """Instruction for the person's next step."""
        if not self._judged:
            what = f"press the ball at the {self.missing_region}"
        elif self._held < _LONG_HOLD:
            what = "lift the ball"
        else:
            what = "lift the ball; if it is lifted, capture the no-contact image again and start over"
        return f"{len(self.images)} of {self._wanted}: {what}"

    def observe(self, image: np.ndarray) -> str:
        """Look at one image (320, 240, 3) uint8 RGB; return the verdict on the press as text, "" while undecided.

        Raises InputError for an image of another size.
        """
        reduced = reduce_image(check_image(image, self._sensor, "tactile image"))
        blocks = coarse(without_drift(self._light.difference(reduced)), _BLOCK)
        change = float(np.abs(blocks).max())
        # a black or saturated image can show little change in spite of a touch
        if change < (_RELEASE_LEVEL if self._judged else _TOUCH_LEVEL) and not exposure_problem(
            image[::4, ::4], MOST_SPOILED
        ):
            self._judged, self._held = False, 0
            self._recent.clear()
            return ""
        self._recent.append(blocks)
        still = len(self._recent) == _STILL_IMAGES and np.ptp(np.stack(self._recent), axis=0).max() < _STILL_LEVEL
        self._held = self._held + 1 if self._judged and still else 0
        if self._judged or not still:
            return ""
        self._judged = True
        return self._judge(image)

    def _judge(self, image: np.ndarray) -> str:
        press = look_at("press", image, self._light, self._radius, self._half)
        if press.problem:
            self.refusals.append(press.problem)
            return f"not taken: {press.problem}"
        near = [press.contact.distance(other) * self._half.pixel_size for other in self._contacts]
        if near and min(near) < _LEAST_DISTANCE:
            self.refusals.append("there was a press at this position already")
            return f"not taken: {self.refusals[-1]}"
        self._contacts.append(press.contact)
        self.images[f"press_{len(self.images):02d}.png"] = image.copy()
        return "taken"

    @property
    def missing_region(self) -> str:
        """Name, out of `REGIONS`, of the ninth of the image with the fewest presses."""
        count = np.zeros((3, 3), int)
        for contact in self._contacts:
            row, column = int(3 * contact.v / self._half.height), int(3 * contact.u / self._half.width)
            count[np.clip(row, 0, 2), np.clip(column, 0, 2)] += 1
        return REGIONS[int(count.argmin())]
