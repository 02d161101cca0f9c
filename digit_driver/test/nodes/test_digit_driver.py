"""The node over real DDS, with a fake kernel below."""

from __future__ import annotations

import functools
import time

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from fake_kernel import FakeDigit, picture
from rcl_interfaces.msg import Log
from rclpy.clock import ClockType
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_srvs.srv import SetBool

from digit_driver.nodes import image_publisher
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import stamp_ns as in_ns

pytestmark = pytest.mark.dds
IMAGES, JPEGS, INFOS = (f"/digit_test/{topic}" for topic in ("image_raw", "image_raw/compressed", "camera_info"))


def stamp_ns(message) -> int:
    return in_ns(message.header.stamp)


def test_images_arrive_whole_with_camera_info_of_the_same_stamp(graph, start, camera) -> None:
    start(frame_id="left_optical_frame")
    infos, images = graph.listen(CameraInfo, INFOS), graph.listen(Image, IMAGES)
    graph.spin_until(lambda: len(images) >= 5, "images")
    for message in images:
        assert (message.width, message.height, message.encoding, message.step) == (240, 320, "rgb8", 720)
        assert message.header.frame_id == "left_optical_frame"
        image = np.frombuffer(message.data, np.uint8).reshape(320, 240, 3).astype(int)
        # the fake camera's red quarter, top right in its landscape image, is top left once that is turned
        assert (image[..., 0] - image[..., 2] > 50)[5:155, 5:115].all()
    stamps = [stamp_ns(message) for message in images]
    assert np.diff(stamps).min() > 0
    assert abs(stamps[-1] - time.time_ns()) < 60_000_000_000
    graph.spin_until(lambda: set(map(stamp_ns, infos)) & set(map(stamp_ns, images)), "the info of an image")
    assert (infos[-1].width, infos[-1].height, infos[-1].k[0]) == (240, 320, 0.0)
    assert infos[-1].header.frame_id == "left_optical_frame"


def test_compresses_only_while_subscribed(graph, start, camera, monkeypatch) -> None:
    made = []
    original = image_publisher.compressed_message

    def spy(*arguments):
        made.append(1)
        return original(*arguments)

    monkeypatch.setattr(image_publisher, "compressed_message", spy)
    driver, images = start(), graph.listen(Image, IMAGES)
    graph.spin_until(lambda: len(images) >= 5, "images")
    assert made == []
    jpegs = graph.listen(CompressedImage, JPEGS)
    graph.spin_until(lambda: jpegs, "a JPEG")
    assert jpegs[0].format == "rgb8; jpeg compressed bgr8"
    bgr = cv2.imdecode(np.frombuffer(jpegs[0].data, np.uint8), cv2.IMREAD_COLOR).astype(int)
    assert bgr.shape == (320, 240, 3)
    assert (bgr[..., 2] - bgr[..., 0] > 50)[5:155, 5:115].all(), "red stays red"
    (subscription,) = (one for one in graph.companion.subscriptions if one.topic_name == JPEGS)
    graph.companion.destroy_subscription(subscription)
    (publisher,) = (one for one in driver.publishers if one.topic_name == JPEGS)
    graph.spin_until(lambda: publisher.get_subscription_count() == 0, "the subscription's end")
    # One image may have been under way when the subscription went.
    count, seen = len(made) + 1, len(images)
    graph.spin_until(lambda: len(images) >= seen + 10, "more images")
    assert len(made) <= count


def set_capture(graph, on: bool) -> SetBool.Response:
    return graph.call(SetBool, "/digit_test/set_capture", SetBool.Request(data=on))


def test_set_capture_stops_and_starts(graph, start, camera) -> None:
    start(diagnostics_period=0.1)
    images = graph.listen(Image, IMAGES)
    graph.spin_until(lambda: images, "an image")
    answer = set_capture(graph, False)
    assert (answer.success, answer.message) == (True, "capture is off")
    opened, taken = camera.opened, camera.sequence
    graph.health().until("capture is off")
    assert camera.sequence == taken
    answered_ns = time.time_ns()
    assert set_capture(graph, True).success
    graph.spin_until(lambda: stamp_ns(images[-1]) > answered_ns, "a new image")
    assert camera.opened > opened


def test_unplugging_is_an_error_until_it_is_plugged_in_again(graph, start, camera, kernel) -> None:
    # the fake stamps when it is read, which a busy machine does unevenly
    start(reconnect_timeout=0.1, diagnostics_period=0.1, fps=60, stamp_jitter_limit=1.0)
    health = graph.health()
    status = health.until("streaming")
    assert (status.level, status.hardware_id) == (DiagnosticStatus.OK, "D20001")
    assert status.name == "digit_driver: /digit_test/digit_driver"
    kernel.unplug(camera)
    status = health.until("disconnected")
    assert (status.level, status.hardware_id) == (DiagnosticStatus.ERROR, "D20001")
    camera.number = 6
    kernel.plug(camera)
    health.clear()
    assert health.until("streaming").level == DiagnosticStatus.OK
    assert (health.values["reconnects"], health.values["source"]) == ("1", "/dev/video6")
    images = graph.listen(Image, IMAGES)
    graph.spin_until(lambda: images, "an image")


def test_no_timer_follows_the_wall_clock(start, camera) -> None:
    """Set back by an hour, it would silence the diagnostics for an hour."""
    assert {timer.clock.clock_type for timer in start().timers} == {ClockType.STEADY_TIME}


def test_uneven_stamps_are_a_warning_in_diagnostics_and_log(graph, start, camera) -> None:
    camera.uneven_ns = 200_000_000
    start(diagnostics_period=0.1)
    # a late subscriber, too, gets what was logged before it was discovered
    health, logs = graph.health(), graph.listen(Log, "/rosout", latched=True, wanted=lambda log: "uneven" in log.msg)
    assert health.until("uneven").level == DiagnosticStatus.WARN
    assert float(health.values["stamp_jitter_s"]) > 0.05
    graph.spin_until(lambda: logs, "the log")
    assert graph.set_parameter("/digit_test/digit_driver", "stamp_jitter_limit", 1.0).successful
    graph.spin_until(lambda: "uneven" not in health.newest.message, "its end")
    assert len(logs) == 1


def test_an_image_that_stays_the_same_is_not_published_on(graph, start, camera) -> None:
    """With fresh stamps it would say that the sensor touches what it touched before."""
    start(diagnostics_period=0.1)
    health, images = graph.health(), graph.listen(Image, IMAGES)
    graph.spin_until(lambda: images, "an image")
    camera.picture = picture(3)
    health.until("image frozen")
    frozen, more = len(images), len(health.statuses) + 3
    graph.spin_until(lambda: len(health.statuses) > more, "some time")
    assert len(images) <= frozen + 1, "one may have been under way"
    camera.picture = None
    graph.spin_until(lambda: len(images) > frozen + 2, "images again")


def test_several_sensors_without_a_serial_are_refused(start, camera, kernel) -> None:
    kernel.plug(FakeDigit("D20002", "1-9", number=4))
    with pytest.raises(InputError, match=r"D20001.*D20002"):
        start()


def test_lifecycle_by_hand(graph, start, camera) -> None:
    driver, change = start(autostart=False), functools.partial(graph.change_state, "/digit_test/digit_driver")
    assert driver.lifecycle_state == "unconfigured"
    assert not set_capture(graph, True).success
    assert change("configure")
    assert camera.opened == 0
    images = graph.listen(Image, IMAGES)
    assert change("activate")
    graph.spin_until(lambda: images, "an image")
    for transition in ("deactivate", "cleanup", "configure"):
        assert change(transition)
    seen = len(images)
    assert change("activate")
    graph.spin_until(lambda: len(images) > seen, "more images")
