"""The node over real DDS, with a fake kernel below."""

from __future__ import annotations

import functools
import time

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from fake_kernel import FakeDigit, picture
from rcl_interfaces.msg import Log
from rclpy.clock import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_srvs.srv import SetBool

from digit_driver.nodes import image_publisher
from midastouch_common.errors import InputError

pytestmark = pytest.mark.dds


def stamp_ns(message) -> int:
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def test_images_arrive_whole_with_camera_info_of_the_same_stamp(peer, camera) -> None:
    it = peer(frame_id="left_optical_frame")
    it.subscribe(CameraInfo, "camera_info")
    it.subscribe(Image, "image_raw", qos_profile_sensor_data)
    images = it.wait("image_raw", lambda got: len(got) >= 5)
    for message in images:
        assert (message.width, message.height, message.encoding, message.step) == (240, 320, "rgb8", 720)
        assert message.header.frame_id == "left_optical_frame"
        image = np.frombuffer(message.data, np.uint8).reshape(320, 240, 3).astype(int)
        # the fake camera's red quarter, top right in its landscape image, is top left once that is turned
        assert (image[..., 0] - image[..., 2] > 50)[5:155, 5:115].all()
    stamps = [stamp_ns(message) for message in images]
    assert np.diff(stamps).min() > 0
    assert abs(stamps[-1] - time.time_ns()) < 60_000_000_000

    def of_an_image(info: CameraInfo) -> bool:
        return any(stamp_ns(info) == stamp_ns(image) for image in it.received["image_raw"])

    infos = it.wait("camera_info", lambda got: any(map(of_an_image, got)))
    assert (infos[-1].width, infos[-1].height, infos[-1].k[0]) == (240, 320, 0.0)
    assert infos[-1].header.frame_id == "left_optical_frame"


def test_compresses_only_while_subscribed(peer, camera, monkeypatch) -> None:
    made = []
    original = image_publisher.compressed_message

    def spy(*arguments):
        made.append(1)
        return original(*arguments)

    monkeypatch.setattr(image_publisher, "compressed_message", spy)
    it = peer()
    it.subscribe(Image, "image_raw")
    it.wait("image_raw", lambda got: len(got) >= 5)
    assert made == []
    subscription = it.subscribe(CompressedImage, "image_raw/compressed")
    message = it.wait("image_raw/compressed")[0]
    assert message.format == "rgb8; jpeg compressed bgr8"
    bgr = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR).astype(int)
    assert bgr.shape == (320, 240, 3)
    assert (bgr[..., 2] - bgr[..., 0] > 50)[5:155, 5:115].all(), "red stays red"
    it.graph.companion.destroy_subscription(subscription)
    (publisher,) = (one for one in it.driver.publishers if one.topic_name.endswith("image_raw/compressed"))
    it.wait("image_raw", lambda got: publisher.get_subscription_count() == 0)
    # One image may have been under way when the subscription went.
    count = len(made) + 1
    seen = len(it.received["image_raw"])
    it.wait("image_raw", lambda got: len(got) >= seen + 10)
    assert len(made) <= count


def test_set_capture_stops_and_starts(peer, camera) -> None:
    it = peer(diagnostics_period=0.1)
    it.subscribe(Image, "image_raw")
    it.wait("image_raw")
    answer = it.call(SetBool, "set_capture", SetBool.Request(data=False))
    assert (answer.success, answer.message) == (True, "capture is off")
    opened, taken = camera.opened, camera.sequence
    it.subscribe(DiagnosticArray, "/diagnostics")
    it.wait("/diagnostics", lambda got: got and got[-1].status[0].message == "capture is off")
    assert camera.sequence == taken
    answered_ns = time.time_ns()
    answer = it.call(SetBool, "set_capture", SetBool.Request(data=True))
    assert answer.success
    it.wait("image_raw", lambda got: stamp_ns(got[-1]) > answered_ns)
    assert camera.opened > opened


def test_unplugging_is_an_error_until_it_is_plugged_in_again(peer, camera, kernel) -> None:
    # the fake stamps when it is read, which a busy machine does unevenly
    it = peer(reconnect_timeout=0.1, diagnostics_period=0.1, fps=60, stamp_jitter_limit=1.0)
    it.subscribe(DiagnosticArray, "/diagnostics")

    def wait_for(words: str, level: bytes):
        def matches(status) -> bool:
            return words in status.message and status.level == level

        return it.wait("/diagnostics", lambda got: got and matches(got[-1].status[0]))[-1].status[0]

    status = wait_for("streaming", b"\x00")
    assert status.name == "digit_driver: /digit_test/digit_driver"
    assert status.hardware_id == "D20001"
    kernel.unplug(camera)
    status = wait_for("disconnected", b"\x02")
    assert status.hardware_id == "D20001"
    camera.number = 6
    kernel.plug(camera)
    status = wait_for("streaming", b"\x00")
    values = {pair.key: pair.value for pair in status.values}
    assert (values["reconnects"], values["source"]) == ("1", "/dev/video6")
    it.subscribe(Image, "image_raw")
    it.wait("image_raw")


def test_no_timer_follows_the_wall_clock(peer, camera) -> None:
    """Set back by an hour, it would silence the diagnostics for an hour."""
    driver = peer().driver
    assert {timer.clock.clock_type for timer in driver.timers} == {ClockType.STEADY_TIME}


def test_uneven_stamps_are_a_warning_in_diagnostics_and_log(peer, camera) -> None:
    camera.uneven_ns = 200_000_000
    it = peer(diagnostics_period=0.1)
    it.subscribe(DiagnosticArray, "/diagnostics")
    # a late subscriber, too, gets what was logged before it was discovered
    it.subscribe(Log, "/rosout", QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    received = it.wait("/diagnostics", lambda got: got and "uneven" in got[-1].status[0].message)
    status = received[-1].status[0]
    assert status.level == b"\x01"
    assert float({pair.key: pair.value for pair in status.values}["stamp_jitter_s"]) > 0.05
    it.wait("/rosout", lambda got: any("uneven" in entry.msg for entry in got))
    assert it.set_parameter("stamp_jitter_limit", 1.0).successful
    it.wait("/diagnostics", lambda got: "uneven" not in got[-1].status[0].message)
    assert sum("uneven" in entry.msg for entry in it.received["/rosout"]) == 1


def test_an_image_that_stays_the_same_is_not_published_on(peer, camera) -> None:
    """With fresh stamps it would say that the sensor touches what it touched before."""
    it = peer(diagnostics_period=0.1)
    it.subscribe(DiagnosticArray, "/diagnostics")
    it.subscribe(Image, "image_raw", qos_profile_sensor_data)
    it.wait("image_raw")
    camera.picture = picture(3)
    it.wait("/diagnostics", lambda got: got and "image frozen" in got[-1].status[0].message)
    frozen = len(it.received["image_raw"])
    more = len(it.received["/diagnostics"]) + 3
    it.wait("/diagnostics", lambda got: len(got) > more)
    assert len(it.received["image_raw"]) <= frozen + 1, "one may have been under way"
    camera.picture = None
    it.wait("image_raw", lambda got: len(got) > frozen + 2)


def test_several_sensors_without_a_serial_are_refused(peer, camera, kernel) -> None:
    kernel.plug(FakeDigit("D20002", "1-9", number=4))
    with pytest.raises(InputError, match=r"D20001.*D20002"):
        peer()


def test_lifecycle_by_hand(graph, peer, camera) -> None:
    it, change = peer(autostart=False), functools.partial(graph.change_state, "/digit_test/digit_driver")
    assert it.driver.lifecycle_state == "unconfigured"
    assert not it.call(SetBool, "set_capture", SetBool.Request(data=True)).success
    assert not change("activate"), "must be configured first"
    assert change("configure")
    assert camera.opened == 0
    it.subscribe(Image, "image_raw")
    assert change("activate")
    it.wait("image_raw")
    assert not change("activate"), "is active already"
    for transition in ("deactivate", "cleanup", "configure"):
        assert change(transition)
    seen = len(it.received["image_raw"])
    assert change("activate")
    it.wait("image_raw", lambda got: len(got) > seen)
