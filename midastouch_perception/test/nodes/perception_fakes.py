"""Small stand-ins for the networks: something simple that depends on every pixel they are given."""

from __future__ import annotations

import numpy as np
from std_msgs.msg import Header

from midastouch_perception.contact import Contact
from midastouch_perception.ros.conversions import image_to_msg, stamp_from_ns

BACKGROUND = np.full((320, 240, 3), 100, np.uint8)


class FakeDepthStage:
    """10 um of penetration per grey level by which the red channel is above the background."""

    skipped = 0

    def __init__(self):
        self.calls = 0

    def process(self, image: np.ndarray, background: np.ndarray) -> tuple[np.ndarray, Contact]:
        self.calls += 1
        rise = image[::2, ::2, 0].astype(np.float32) - background[::2, ::2, 0]
        penetration = np.maximum(rise, 0) * np.float32(1e-5)
        mask = penetration > 0
        return penetration, Contact(bool(mask.any()), 1e-8 * np.count_nonzero(mask), mask)

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
