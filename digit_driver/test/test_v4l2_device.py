import errno
import threading

import cv2
import numpy as np
import pytest
from fake_kernel import FakeDigit, yuyv

from digit_driver import videodev2 as v4l2
from digit_driver.camera_model import CameraModel
from digit_driver.frames import CorruptFrameError, DeviceError
from digit_driver.v4l2_device import V4l2Camera, V4l2Settings
from midastouch_common.errors import InputError


@pytest.fixture
def device(kernel, find):
    """Makes devices and closes them at the end."""
    made = []

    def make(**settings) -> V4l2Camera:
        made.append(V4l2Camera(V4l2Settings(**settings), kernel, find))
        return made[-1]

    yield make
    for digit in made:
        digit.close()
    assert kernel.descriptors == {}, "descriptors left open"


def test_streams_portrait_frames_with_the_kernels_time(kernel, device) -> None:
    camera = kernel.plug(FakeDigit())
    digit = device()
    info = digit.open()
    assert (info.name, info.serial, info.width, info.height, info.fps) == ("/dev/video0", "D20001", 240, 320, 60)
    assert info.warnings == ()
    assert camera.requested_fps == 60
    frames = [digit.read(1.0) for _ in range(10)]
    assert [frame.sequence for frame in frames] == list(range(10))
    assert frames[-1].stamp_monotonic_ns == camera.last_stamp_ns
    assert frames[0].image.shape == (320, 240, 3)
    assert frames[0].image.mean() < frames[9].image.mean()


def mini_picture() -> bytes:
    """A JPEG of 3280 x 2464: white where the GelSight Mini's gel is not seen, red in the gel's top right quarter."""
    image = np.full((2464, 3280, 3), 255, np.uint8)
    image[352:2112, 469:2811] = 40
    image[352:1232, 1640:2811] = (0, 0, 250)
    return cv2.imencode(".jpg", image)[1].tobytes()


def test_a_gelsight_mini_gives_portrait_images_of_its_gel(kernel, device) -> None:
    kernel.plug(FakeDigit("D20001", "1-1", number=0))
    mini = FakeDigit("28GHEJZ8", "1-2", number=2, vendor="1234", product="GelSight Mini R0B 28GH-EJZ8")
    mini.pixel_format, mini.picture = v4l2.PIX_FMT_MJPEG, mini_picture()
    kernel.plug(mini)
    sensor = device(camera=CameraModel.load("gelsight_mini"))
    info = sensor.open()
    assert (info.name, info.serial, info.width, info.height, info.fps) == ("/dev/video2", "28GHEJZ8", 240, 320, 25)
    assert info.warnings == ()
    assert mini.requested_format == (3280, 2464, v4l2.PIX_FMT_MJPEG)
    image = sensor.read(1.0).image
    assert image.shape == (320, 240, 3)
    assert image[5:155, 5:115, 0].min() > 180
    assert image[165:-3, 3:-3].max() < 80, "nothing beyond the gel"
    sensor.set_leds((1, 2, 3))
    assert mini.led_values == [], "its lights cannot be set"


def test_vga(kernel, device) -> None:
    camera = kernel.plug(FakeDigit())
    camera.picture = bytes(2 * 640 * 480)
    digit = device(resolution="VGA", fps=30)
    assert digit.open().height == 640
    assert digit.read(1.0).image.shape == (640, 480, 3)


def test_metadata_node_is_skipped_even_if_it_comes_first(kernel, device) -> None:
    kernel.plug(FakeDigit(number=4), metadata_first=True)
    assert device().open().name == "/dev/video5"


def test_video_device_overrides_the_search(kernel, device) -> None:
    kernel.plug(FakeDigit("D1", "1-1", number=0))
    kernel.plug(FakeDigit("D2", "1-2", number=2))
    info = device(video_device="/dev/video2").open()
    assert (info.name, info.serial) == ("/dev/video2", "D2")


@pytest.mark.parametrize("linked", [False, True])
def test_a_serial_number_outweighs_the_node_of_another_sensor(kernel, device, tmp_path, linked) -> None:
    """As after a start at which the sensors came in another order."""
    kernel.plug(FakeDigit("D2", "1-1", number=0))
    kernel.plug(FakeDigit("D1", "1-2", number=2))
    node = tmp_path / "by-path"
    node.symlink_to("/dev/video0")
    info = device(serial="D1", video_device=str(node) if linked else "/dev/video0").open()
    assert (info.name, info.serial) == ("/dev/video2", "D1")
    (warning,) = info.warnings
    assert "is the sensor D2; took D1 at USB 1-2" in warning


def test_a_serial_number_that_is_not_there_is_waited_for(kernel, device) -> None:
    kernel.plug(FakeDigit("D2", number=0))
    digit = device(serial="D1", video_device="/dev/video0")
    with pytest.raises(DeviceError, match="no DIGIT D1 found"):
        digit.open()
    kernel.plug(FakeDigit("D1", "1-2", number=2))
    assert digit.open().serial == "D1"


def test_serial_and_node_that_agree_open_without_a_word(kernel, device) -> None:
    kernel.plug(FakeDigit("D1", "1-1", number=0))
    kernel.plug(FakeDigit("D1", "1-2", number=2))
    info = device(serial="D1", video_device="/dev/video2").open()
    assert (info.name, info.serial, info.warnings) == ("/dev/video2", "D1", ())


def test_a_node_that_no_sensor_is_known_to_own_is_opened_with_a_warning(kernel, device) -> None:
    kernel.plug(FakeDigit("D1", number=0, vendor="1234"))
    info = device(serial="D1", video_device="/dev/video0").open()
    assert (info.name, info.serial) == ("/dev/video0", "")
    assert "it is not known whether /dev/video0 is the sensor D1" in info.warnings[0]


def test_a_bare_number_among_several_sensors_is_told_to_change(kernel, device, tmp_path) -> None:
    kernel.plug(FakeDigit("D1", "1-1", number=0))
    assert device(video_device="/dev/video0").open().warnings == ()
    kernel.plug(FakeDigit("D2", "1-2", number=2))
    (warning,) = device(video_device="/dev/video2").open().warnings
    assert "is the sensor D2 now" in warning
    assert "set `serial`, too" in warning
    link = tmp_path / "digit_D2"
    link.symlink_to("/dev/video2")
    assert device(video_device=str(link)).open().warnings == ()


def test_a_link_of_udevs_means_whatever_is_plugged_in_there(kernel, device, tmp_path) -> None:
    link = tmp_path / "by-path"
    link.symlink_to("/dev/video0")
    first = kernel.plug(FakeDigit("D1", number=0))
    digit = device(video_device=str(link))
    assert digit.open().serial == "D1"
    kernel.unplug(first)
    kernel.plug(FakeDigit("D2", number=0))
    assert digit.open().serial == "D2"


def test_leds_are_packed_and_survive_a_replug(kernel, device) -> None:
    camera = kernel.plug(FakeDigit())
    digit = device(leds=(15, 8, 0))
    digit.open()
    digit.set_leds((1, 2, 3))
    assert camera.led_values == [0xF80, 0x123]
    digit.close()
    digit.set_leds((0, 0, 9))
    assert camera.led_values == [0xF80, 0x123]
    digit.open()
    assert camera.led_values[-1] == 0x009


def test_old_firmware_gets_one_brightness_and_a_warning(kernel, device) -> None:
    camera = kernel.plug(FakeDigit(revision="0150"))
    info = device(leds=(3, 12, 5)).open()
    assert camera.led_values == [12]
    assert "firmware 150" in info.warnings[0]


def test_leds_that_cannot_be_set_do_not_stop_the_images(kernel, device) -> None:
    kernel.plug(FakeDigit(errors={v4l2.VIDIOC_S_CTRL: errno.EINVAL}))
    digit = device()
    assert "setting the LEDs failed" in digit.open().warnings[0]
    assert digit.read(1.0) is not None
    with pytest.raises(DeviceError, match="LEDs"):
        digit.set_leds((1, 1, 1))


def test_other_frame_rate_than_asked_for_is_told(kernel, device) -> None:
    kernel.plug(FakeDigit(granted_fps=30))
    info = device().open()
    assert info.fps == 30
    assert "30 frames per second instead of 60" in info.warnings[0]


NODE = {"video_device": "/dev/video0"}


@pytest.mark.parametrize(
    ("fault", "settings", "error", "message"),
    [
        ({}, {"video_device": "/dev/video1"}, DeviceError, "metadata node"),
        ({"errors": {v4l2.VIDIOC_QUERYCAP: errno.ENOTTY}}, NODE, DeviceError, "not a V4L2 device"),
        ({"size": (1280, 720)}, {}, InputError, "1280x720 instead of 320x240"),
        ({"pixel_format": v4l2.fourcc("H264")}, {}, InputError, "YUYV"),
        ({"open_error": errno.EACCES}, {}, DeviceError, "udev rule"),
        ({"open_error": errno.ENOENT}, {}, DeviceError, "video0"),
        ({"errors": {v4l2.VIDIOC_S_FMT: errno.EBUSY}}, {}, DeviceError, "another program"),
    ],
)
def test_what_cannot_be_opened_is_closed_and_says_why(kernel, device, fault, settings, error, message) -> None:
    kernel.plug(FakeDigit(**fault))
    with pytest.raises(error, match=message):
        device(**settings).open()
    assert kernel.descriptors == {}


@pytest.mark.parametrize("step", ["S_FMT", "S_PARM", "REQBUFS", "QUERYBUF", "QBUF", "STREAMON"])
def test_failure_at_any_step_of_opening_leaves_nothing_open(kernel, device, step) -> None:
    camera = kernel.plug(FakeDigit(errors={getattr(v4l2, f"VIDIOC_{step}"): errno.EIO}))
    digit = device()
    with pytest.raises(DeviceError, match="/dev/video0"):
        digit.open()
    assert kernel.descriptors == {}
    camera.errors.clear()
    digit.open()
    assert digit.read(1.0) is not None


@pytest.mark.parametrize(
    ("fault", "settings"),
    [
        ({"stamp_flags": 0}, {}),
        ({"stamp_shift_ns": -(10**12)}, {}),
        ({"stamp_shift_ns": 10**12}, {}),
        ({}, {"use_buffer_timestamps": False}),
    ],
    ids=["unknown clock", "ancient", "future", "switched off"],
)
def test_stamps_not_to_be_used_are_those_of_reading(kernel, device, fault, settings) -> None:
    camera = kernel.plug(FakeDigit(**fault))
    digit = device(**settings)
    digit.open()
    stamp = digit.read(1.0).stamp_monotonic_ns
    assert 3_000_000 <= stamp - camera.last_stamp_ns < 1_000_000_000


def test_a_frame_that_waited_for_a_halted_process_is_dropped(kernel, device) -> None:
    """It shows what was; stamped as new, the next one would be older."""
    camera = kernel.plug(FakeDigit())
    digit = device()
    digit.open()
    first = digit.read(1.0).stamp_monotonic_ns
    camera.stamp_shift_ns = -3_000_000_000
    with pytest.raises(CorruptFrameError, match=r"3\.\d s old when it was read"):
        digit.read(1.0)
    camera.stamp_shift_ns = 0
    assert digit.read(1.0).stamp_monotonic_ns > first


def touched(step: int) -> np.ndarray:
    """A landscape image (240, 320) of grey levels with a contact that slides along its rows and noise."""
    y, x = np.mgrid[0:240, 0:320]
    across, down = (x - 90 - 12 * step) / 40, (y - 120) / 40
    bump = np.exp(-2 * (across**2 + down**2))
    noise = np.random.default_rng(step).normal(0, 1.5, bump.shape)
    return np.clip(np.rint(110 + 120 * bump * across + noise), 0, 255).astype(np.uint8)


def test_torn_frames_are_dropped(kernel, device) -> None:
    """Upper rows of one frame, lower rows of the next, as a DIGIT hands them out now and then."""
    camera, digit = kernel.plug(FakeDigit()), device()
    camera.picture = yuyv(touched(0))
    digit.open()
    for step in range(4):
        camera.picture = yuyv(touched(step))
        assert digit.read(1.0) is not None
    torn = touched(4)
    torn[118:] = touched(5)[118:]
    camera.picture = yuyv(torn)
    with pytest.raises(CorruptFrameError, match="torn"):
        digit.read(1.0)
    camera.picture = yuyv(touched(5))
    assert digit.read(1.0).sequence == 5


def test_leds_may_be_set_while_the_device_is_opened_and_closed(kernel, device) -> None:
    kernel.plug(FakeDigit())
    digit = device()
    done = threading.Event()
    failures = []

    def light() -> None:
        while not done.is_set():
            try:
                digit.set_leds((1, 2, 3))
            except Exception as error:
                failures.append(error)

    thread = threading.Thread(target=light)
    thread.start()
    for _ in range(12):
        digit.open()
        digit.read(0.01)
        digit.close()
    done.set()
    thread.join()
    assert failures == []
