"""Small stand-ins for the networks: something simple that depends on every pixel they are given."""

from __future__ import annotations

import numpy as np
from std_msgs.msg import Header

from midastouch_common.ros.conversions import image_to_msg, stamp_from_ns
from midastouch_perception.contact import Contact, in_steps
from midastouch_perception.sensor_model import SensorModel

BACKGROUND = np.full((320, 240, 3), 100, np.uint8)


class FakeDepthStage:
    """10 um of penetration per grey level by which the red channel is above the background."""

    def __init__(self):
        self.calls = 0
        self.skipped = {"image_unchanged": 0, "no_contact": 0}
        self._sensor = SensorModel.load("digit_tacto").scaled(0.5)

    def process(self, image: np.ndarray, background: np.ndarray) -> Contact:
        self.calls += 1
        rise = image[::2, ::2, 0].astype(np.float32) - background[::2, ::2, 0]
        return Contact.of(in_steps(np.maximum(rise, 0) * np.float32(1e-5)), self._sensor)

    def deferred_update(self) -> None:
        pass

    def shows_contact(self, candidate: np.ndarray, background: np.ndarray) -> bool:
        return bool((candidate > background).any())


class FakeTcn:
    """The penetration map's block means as a unit vector of 48 numbers."""

    network_id = "fake-000000000000"

    def __init__(self):
        self.calls = 0

    def encode(self, penetration: np.ndarray) -> np.ndarray:
        self.calls += 1
        blocks = penetration.reshape(8, 20, 6, 20).mean(axis=(1, 3)).ravel()
        return (blocks / np.linalg.norm(blocks)).astype(np.float32)


def touched(row: int, height: int = 40) -> np.ndarray:
    """The background with a contact 40 pixels wide that starts at a row."""
    image = BACKGROUND.copy()
    image[row : row + height, 100:140, 0] += np.arange(height, dtype=np.uint8)[:, None] + 10
    return image


def image_msg(pixels: np.ndarray, stamp: int, encoding: str = "rgb8"):
    """An image message, stamp in ns."""
    header = Header(stamp=stamp_from_ns(stamp), frame_id="digit_optical_frame")
    return image_to_msg(pixels, encoding, header)
