"""The node over real DDS, with recordings and with a fake kernel below."""

from __future__ import annotations

import functools
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from fake_kernel import FakeDigit
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_srvs.srv import SetBool

from digit_driver import sources
from digit_driver.errors import InputError
from digit_driver.nodes import messages
from digit_driver.nodes.digit_driver import DigitDriver
from digit_driver.nodes.parameters import PARAMETERS
from digit_driver.v4l2_device import V4l2Digit

pytestmark = pytest.mark.dds
DOMAIN = 42
README = Path(__file__).parents[2] / "README.md"


class Peer:
    """A driver and a node that listens to it, both spinning in a thread of their own."""

    def __init__(self, **parameters) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=DOMAIN)
        self.received: dict[str, list] = {}
        self._changed = threading.Condition()
        try:
            overrides = [Parameter(name, value=value) for name, value in parameters.items()]
            self.driver = DigitDriver(
                context=self.context, namespace="/digit_test", parameter_overrides=overrides
            )
        except InputError:
            self.context.shutdown()
            raise
        self.node = rclpy.create_node("peer", namespace="/digit_test", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.driver)
        self._executor.add_node(self.node)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        while not self._stopping.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._stopping.set()
        self._thread.join()
        self.driver.destroy_node()
        self.node.destroy_node()
        self._executor.shutdown()
        self.context.shutdown()

    def subscribe(self, kind: type, topic: str, qos=10):
        inbox = self.received.setdefault(topic, [])

        def store(message) -> None:
            with self._changed:
                inbox.append(message)
                self._changed.notify_all()

        return self.node.create_subscription(kind, topic, store, qos)

    def wait(self, topic: str, predicate: Callable[[list], object] = bool):
        """The messages of a topic, once ``predicate`` holds for them."""
        with self._changed:
            inbox = self.received[topic]
            assert self._changed.wait_for(lambda: predicate(inbox), timeout=15.0), f"{topic}: {inbox[-1:]}"
            return list(inbox)

    def call(self, kind: type, name: str, request):
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(10.0)
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        assert answered.wait(10.0), name
        return future.result()

    def set_parameter(self, name: str, value):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, "digit_driver/set_parameters", request).results[0]


@pytest.fixture
def peer():
    """Starts drivers with the given parameters and ends them."""
    peers = []

    def start(**parameters) -> Peer:
        peers.append(Peer(**parameters))
        return peers[-1]

    yield start
    for item in peers:
        item.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four noisy portrait images, 0.png ... 3.png."""
    rng = np.random.default_rng(0)
    path = tmp_path / "images"
    path.mkdir()
    for i in range(4):
        cv2.imwrite(str(path / f"{i}.png"), rng.integers(60, 120, (320, 240, 3)).astype(np.uint8))
    return path


@pytest.fixture
def camera(kernel, find, monkeypatch) -> FakeDigit:
    """A sensor plugged into the fake machine, which the driver takes for the real one."""
    monkeypatch.setattr(sources, "V4l2Digit", functools.partial(V4l2Digit, system=kernel, find=find))
    return kernel.plug(FakeDigit("D20001"))


def stamp_ns(message) -> int:
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def test_images_arrive_whole_with_camera_info_of_the_same_stamp(peer, folder) -> None:
    it = peer(replay_path=str(folder), replay_fps=20.0, frame_id="left_optical_frame")
    it.subscribe(CameraInfo, "camera_info")
    it.subscribe(Image, "image_raw", qos_profile_sensor_data)
    images = it.wait("image_raw", lambda got: len(got) >= 5)
    files = [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in sorted(folder.iterdir())]
    for message in images:
        assert (message.width, message.height, message.encoding, message.step) == (240, 320, "rgb8", 720)
        assert message.header.frame_id == "left_optical_frame"
        image = np.frombuffer(message.data, np.uint8).reshape(320, 240, 3)
        assert any(np.array_equal(image, file) for file in files)
    stamps = [stamp_ns(message) for message in images]
    # Frames may be dropped on a busy machine, but their stamps stay on the grid to well within a millisecond.
    periods = np.diff(stamps) / 50_000_000
    assert np.abs(periods - periods.round()).max() < 0.02
    assert periods.min() > 0.5
    assert abs(stamps[-1] - time.time_ns()) < 5_000_000_000
    infos = it.wait("camera_info", lambda got: any(stamp_ns(info) == stamps[-1] for info in got))
    assert (infos[-1].width, infos[-1].height, infos[-1].k[0]) == (240, 320, 0.0)
    assert infos[-1].header.frame_id == "left_optical_frame"


def test_compresses_only_while_subscribed(peer, folder, monkeypatch) -> None:
    made = []
    original = messages.compressed_message

    def spy(*arguments):
        made.append(1)
        return original(*arguments)

    monkeypatch.setattr(messages, "compressed_message", spy)
    it = peer(replay_path=str(folder), replay_fps=100.0)
    it.subscribe(Image, "image_raw")
    it.wait("image_raw", lambda got: len(got) >= 5)
    assert made == []
    subscription = it.subscribe(CompressedImage, "image_raw/compressed")
    message = it.wait("image_raw/compressed")[0]
    assert message.format == "rgb8; jpeg compressed bgr8"
    image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (320, 240, 3)
    it.node.destroy_subscription(subscription)
    before = it.driver._jpeg_pub
    deadline = time.monotonic() + 10.0
    while before.get_subscription_count() and time.monotonic() < deadline:
        time.sleep(0.01)
    # One image may have been under way when the subscription went.
    count = len(made) + 1
    seen = len(it.received["image_raw"])
    it.wait("image_raw", lambda got: len(got) >= seen + 10)
    assert len(made) <= count


def test_jpeg_keeps_colours(peer, folder) -> None:
    for path in folder.iterdir():
        cv2.imwrite(str(path), np.full((320, 240, 3), (30, 80, 160), np.uint8))
    it = peer(replay_path=str(folder), replay_fps=50.0)
    it.subscribe(CompressedImage, "image_raw/compressed")
    message = it.wait("image_raw/compressed")[0]
    bgr = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(bgr.mean(axis=(0, 1)) - (30, 80, 160)).max() < 3


def test_set_capture_stops_and_starts(peer, camera) -> None:
    it = peer()
    it.subscribe(Image, "image_raw")
    it.wait("image_raw")
    answer = it.call(SetBool, "set_capture", SetBool.Request(data=False))
    assert (answer.success, answer.message) == (True, "capture is off")
    opened = camera.opened
    seen = len(it.received["image_raw"])
    it.subscribe(DiagnosticArray, "/diagnostics")
    it.wait("/diagnostics", lambda got: got and got[-1].status[0].message == "capture is off")
    assert len(it.received["image_raw"]) <= seen + 2  # What DDS still had under way.
    seen = len(it.received["image_raw"])
    answer = it.call(SetBool, "set_capture", SetBool.Request(data=True))
    assert answer.success
    it.wait("image_raw", lambda got: len(got) > seen)
    assert camera.opened > opened


def test_illegal_changes_are_refused_with_a_reason(peer, folder) -> None:
    it = peer(replay_path=str(folder))
    for name, value, reason in [
        ("intensity", 16, "range"),
        ("intensity", 1.5, "type"),
        ("intensity_rgb", [15, 15], r"three levels in 0\.\.\.15"),
        ("intensity_rgb", [0, 0, 99], r"three levels in 0\.\.\.15"),
        ("jpeg_quality", 0, "range"),
        ("serial", "D9", "read-only"),
        ("fps", 30, "read-only"),
        ("use_sim_time", True, "wall clock"),
        ("intensitty", 3, "not been declared|undeclared|not declared"),
    ]:
        result = it.set_parameter(name, value)
        assert not result.successful, name
        assert re.search(reason, result.reason), (name, result.reason)
    assert it.set_parameter("jpeg_quality", 80).successful


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"resolution": "HD"}, "resolution.*QVGA, VGA"),
        ({"fps": 61}, "fps.*60, 30, 15"),
        ({"resolution": "VGA", "fps": 60}, "fps.*30 or 15"),
        ({"intensity": 99}, "intensity"),
        ({"intensity_rgb": [1]}, "intensity_rgb.*three"),
        ({"reconnect_timeout": 1}, r"reconnect_timeout.*1\.0 instead of 1"),
        ({"seriall": "D1"}, "no parameter seriall; did you mean serial"),
        ({"use_sim_time": True}, "use_sim_time"),
        ({"replay_path": "/nowhere/at/all"}, "replay_path: /nowhere/at/all does not exist"),
        ({"camera_info_url": "/nowhere.yaml"}, "camera_info_url: /nowhere.yaml cannot be read"),
    ],
)
def test_bad_parameters_stop_the_start_with_a_reason(peer, parameters, reason) -> None:
    with pytest.raises(InputError, match=reason):
        peer(**parameters)


def test_folder_without_images_stops_the_start_with_a_reason(peer, tmp_path) -> None:
    with pytest.raises(InputError, match="holds no images"):
        peer(replay_path=str(tmp_path))


def test_unplugging_is_an_error_and_replugging_mends_it(peer, camera, kernel) -> None:
    it = peer(reconnect_timeout=0.1, diagnostics_period=0.1, fps=60)
    it.subscribe(DiagnosticArray, "/diagnostics")

    def wait_for(words: str):
        received = it.wait("/diagnostics", lambda got: got and words in got[-1].status[0].message)
        return received[-1].status[0]

    status = wait_for("streaming")
    assert status.name == "digit_test/digit_driver: stream"
    assert status.hardware_id == "D20001"
    assert status.level == b"\x00"
    kernel.unplug(camera)
    status = wait_for("disconnected")
    assert status.level == b"\x02"
    assert status.hardware_id == "D20001"
    camera.number = 6
    kernel.plug(camera)
    status = wait_for("streaming")
    values = {pair.key: pair.value for pair in status.values}
    assert (values["reconnects"], values["source"]) == ("1", "/dev/video6")
    it.subscribe(Image, "image_raw")
    it.wait("image_raw")


def test_intensity_reaches_the_leds_at_run_time(peer, camera) -> None:
    it = peer(intensity=15, intensity_rgb=[15, 0, 0])
    assert it.set_parameter("intensity_rgb", [0, 15, 15]).successful
    assert it.set_parameter("intensity", 5).successful
    assert camera.led_values == [0xF00, 0x0FF, 0x055]


def test_late_sensor_is_waited_for(peer, camera, kernel) -> None:
    kernel.unplug(camera)
    it = peer(reconnect_timeout=0.1)
    it.subscribe(Image, "image_raw")
    assert it.driver.failure == ""
    kernel.plug(camera)
    it.wait("image_raw")


def test_several_sensors_without_a_serial_are_refused(peer, camera, kernel) -> None:
    kernel.plug(FakeDigit("D20002", "1-9", number=4))
    with pytest.raises(InputError, match=r"D20001.*D20002"):
        peer()


def test_lifecycle_by_hand(peer, camera) -> None:
    it = peer(autostart=False)

    def change(transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return it.call(ChangeState, "digit_driver/change_state", request).success

    assert it.driver.lifecycle_state == "unconfigured"
    assert not it.call(SetBool, "set_capture", SetBool.Request(data=True)).success
    assert not change(Transition.TRANSITION_ACTIVATE), "must be configured first"
    assert change(Transition.TRANSITION_CONFIGURE)
    assert camera.opened == 0
    it.subscribe(Image, "image_raw")
    assert change(Transition.TRANSITION_ACTIVATE)
    it.wait("image_raw")
    assert not change(Transition.TRANSITION_ACTIVATE), "is active already"
    assert change(Transition.TRANSITION_DEACTIVATE)
    assert change(Transition.TRANSITION_CLEANUP)
    assert change(Transition.TRANSITION_CONFIGURE)
    seen = len(it.received["image_raw"])
    assert change(Transition.TRANSITION_ACTIVATE)
    it.wait("image_raw", lambda got: len(got) > seen)


def run_driver(*arguments: str, **options) -> subprocess.Popen:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}
    command = [sys.executable, "-m", "digit_driver.nodes.digit_driver", "--ros-args", *arguments]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, **options)


@pytest.mark.parametrize(
    ("yaml", "code", "words"),
    [
        ("intensitty: 3", 2, "no parameter intensitty; did you mean intensity?"),
        ("replay_path: /nowhere", 2, "/nowhere does not exist"),
        ("{serial: no-such-serial, wait_for_device_timeout: 0.1, reconnect_timeout: 0.1}", 1, "no DIGIT"),
    ],
)
def test_process_ends_with_a_code_and_one_reason(tmp_path, yaml, code, words) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(f"digit_driver:\n  ros__parameters:\n    {yaml}\n")
    process = run_driver("--params-file", str(path))
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code, errors
    assert words in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("moment", ["240x320 at 60 frames/s", "played to its end"])
def test_process_ends_well_when_told_to_while_starting_and_while_spinning(folder, number, moment) -> None:
    process = run_driver("-p", f"replay_path:={folder}", "-p", "replay_loop:=false")
    for line in process.stderr:
        if moment in line:
            break
    process.send_signal(number)
    _, errors = process.communicate(timeout=15)
    assert process.returncode == 0, errors


def test_readme_tables_equal_the_node() -> None:
    rows = dict(re.findall(r"^\| `([^`]+)` \| `?([^|`]+)`? \|", README.read_text(), re.MULTILINE))
    for parameter in PARAMETERS:
        shown = rows.pop(parameter.name)
        default = parameter.default
        expected = str(default).lower() if isinstance(default, bool) else str(default) or "''"
        assert shown == expected, parameter.name
    assert {name: kind.strip() for name, kind in rows.items()} == {
        "image_raw": "sensor_msgs/Image",
        "image_raw/compressed": "sensor_msgs/CompressedImage",
        "camera_info": "sensor_msgs/CameraInfo",
        "/diagnostics": "diagnostic_msgs/DiagnosticArray",
        "set_capture": "std_srvs/SetBool",
    }
