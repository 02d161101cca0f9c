"""What only a real DIGIT can show. Run with DIGIT_HARDWARE=1 and a sensor plugged in."""

import time

import pytest

from digit_driver.camera_model import CameraModel
from digit_driver.discovery import find_cameras
from digit_driver.v4l2_device import V4l2Camera, V4l2Settings

pytestmark = pytest.mark.hardware


@pytest.fixture
def digit():
    (first, *_) = find_cameras(CameraModel.load("digit"))
    device = V4l2Camera(V4l2Settings(serial=first.serial))
    yield device
    device.close()


def test_a_sensor_is_found_with_its_serial() -> None:
    assert find_cameras(CameraModel.load("digit"))[0].serial.startswith("D")


def test_sixty_frames_a_second_with_steady_kernel_stamps(digit) -> None:
    assert digit.open().fps == 60
    frames = [frame for _ in range(200) if (frame := digit.read(0.5)) is not None][20:]
    stamps = [frame.stamp_monotonic_ns for frame in frames]
    seconds = (stamps[-1] - stamps[0]) * 1e-9
    assert (len(stamps) - 1) / seconds == pytest.approx(60.0, rel=0.05)
    assert 0 <= time.monotonic_ns() - stamps[-1] < 200_000_000


def test_each_led_lights_its_own_colour(digit) -> None:
    digit.open()
    for channel in range(3):
        levels = [0, 0, 0]
        levels[channel] = 15
        digit.set_leds(tuple(levels))
        # The exposure needs some frames to follow.
        images = [digit.read(0.5).image for _ in range(30)]
        means = images[-1].mean(axis=(0, 1))
        assert means.argmax() == channel, means
