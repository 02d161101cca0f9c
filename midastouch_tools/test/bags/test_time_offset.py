"""A texture under a sensor that slides with starts and stops, stamped wrongly by a known time."""

import re

import cv2
import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_tools.bags import images as bag_images
from midastouch_tools.bags.images import BagFrame
from midastouch_tools.bags.time_offset import estimate_time_offset
from midastouch_tools.cli import main

PIXEL = 8e-5  # m
TEXTURE = cv2.GaussianBlur(np.random.default_rng(0).uniform(0, 255, (320, 6000)).astype(np.float32), (0, 0), 4)


TIMES = np.linspace(-1, 20, 21_000)  # s
WAY = 0.03 * np.cumsum(np.sin(2.1 * TIMES) + np.sin(3.7 * TIMES) > 0) * (TIMES[1] - TIMES[0])  # m


def stop_and_go(seconds):
    """Way [m] after some seconds: 30 mm/s, with rests of half a second."""
    return np.interp(seconds, TIMES, WAY)


def steadily(seconds):
    return 0.02 * (seconds + 1)


def frames(way, offset, seconds=12.0, fps=30.0):
    """Images stamped `offset` seconds too late, with the pose that the arm had at that stamp."""
    rng = np.random.default_rng(1)
    for stamp in np.arange(0, seconds, 1 / fps):
        x = way(stamp - offset) / PIXEL
        shift = np.array([[1, 0, -x], [0, 1, 0]])
        grey = cv2.warpAffine(TEXTURE, shift, (120, 160)) + rng.normal(0, 2.0, (160, 120))
        image = np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
        yield BagFrame(round(1e9 * stamp), image, se3.translation([way(stamp), 0, 0]), None)


STILL = next(frames(stop_and_go, 0.0))


@pytest.mark.parametrize("offset", [-0.15, 0.0, 0.08, 0.3])
def test_the_offset_is_found_to_a_fraction_of_a_frame(offset):
    found = estimate_time_offset(frames(stop_and_go, offset), "x.mcap")
    assert found.seconds == pytest.approx(offset, abs=0.005)
    assert found.correlation > 0.8


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (frames(steadily, 0.1), "start and stop several times"),
        (frames(stop_and_go, 0.1, seconds=3.0), "record a longer slide"),
        ([], "record a longer slide"),
        ([BagFrame(i * 10**8, *STILL[1:]) for i in range(100)], "edges of an object"),
    ],
)
def test_a_recording_that_does_not_tell_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        estimate_time_offset(given, "x.mcap")


def test_the_command_says_what_to_set(monkeypatch, capsys):
    monkeypatch.setattr(bag_images, "read_bag", lambda *_, **__: frames(stop_and_go, 0.08))
    assert main(["time-offset", "slide.mcap"]) == 0
    said = capsys.readouterr().out
    told, mend = re.search(r"stamped (\d+) ms too late .*\nadd (-\d+) to .* timestamp_offset", said).groups()
    assert int(told) == pytest.approx(80, abs=5)
    assert int(mend) == pytest.approx(-80e6, abs=5e6)
    monkeypatch.setattr(bag_images, "read_bag", lambda *_, **__: [])
    assert main(["time-offset", "slide.mcap"]) == 2
    assert "slide.mcap: needs 6 s" in capsys.readouterr().err
