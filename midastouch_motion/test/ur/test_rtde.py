import contextlib
import socket
import sys
import threading
import types

import numpy as np
import pytest

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND
from midastouch_motion.ur import rtde
from midastouch_motion.ur.rtde import (
    BASE_LINK_FROM_BASE,
    RobotClock,
    require_outputs,
    rtde_connector,
    tool_from_tcp,
    transform_from_rtde,
)

from .ur_controller import Controller, serve_rtde


@pytest.fixture
def ur_rtde(monkeypatch):
    """Stands for the library; its class is for the test to set."""
    module = types.ModuleType("rtde_receive")
    module.RTDEReceiveInterface = None
    monkeypatch.setitem(sys.modules, "rtde_receive", module)
    return module


@pytest.fixture
def listen():
    """Starts a server that treats one client as told; returns its port."""
    with contextlib.ExitStack() as open_:

        def start(treat) -> int:
            server = open_.enter_context(socket.create_server(("127.0.0.1", 0)))

            def once() -> None:
                with contextlib.suppress(OSError):
                    client, _ = server.accept()
                    with client:
                        treat(client)

            threading.Thread(target=once, daemon=True).start()
            return server.getsockname()[1]

        yield start


def faulty(fault):
    """A controller with this fault."""
    return lambda client: serve_rtde(client, Controller(fault))


@pytest.fixture
def controller(monkeypatch, listen):
    """Speaks RTDE, on a port in the place of the controller's."""
    monkeypatch.setattr(rtde, "RTDE_PORT", listen(faulty("")))


def test_missing_package_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "rtde_receive", None)
    with pytest.raises(InputError, match="pip install ur-rtde"):
        rtde_connector()


def test_a_state_is_never_put_together_from_two(ur_rtde, controller):
    """The library's thread puts in the next one while this one is read."""

    class Hurried:
        """Answers like ur-rtde's RTDEReceiveInterface."""

        time, calls = 10.0, 0

        def __init__(self, robot_ip, rate, outputs):
            self.arguments = robot_ip, rate, outputs

        def isConnected(self):
            return True

        def getTimestamp(self):
            return self.time

        def getActualTCPPose(self):
            pose = [self.time] * 6
            self.calls += 1
            if self.calls in (1, 2):
                self.time += 0.008
            return pose

        def getActualQ(self):
            return [self.time] * 6

        getActualQd = getActualTCPForce = getActualQ

    ur_rtde.RTDEReceiveInterface = Hurried
    state = rtde_connector(timeout=60.0)("127.0.0.1", 125.0).read()
    assert state.robot_time == pytest.approx(10.016)
    assert set(state.tcp_pose) == set(state.positions) == {state.robot_time}


def test_an_arm_that_does_not_answer_is_named(ur_rtde, monkeypatch):
    connect = rtde_connector(timeout=0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    monkeypatch.setattr(rtde, "RTDE_PORT", port)
    with pytest.raises(ConnectionError, match=f"127.0.0.1:{port}"):
        connect("127.0.0.1", 125.0)


def test_a_refusal_of_the_library_is_a_connection_error(ur_rtde, controller):
    def refuse(*_):
        raise RuntimeError("protocol version 2 not accepted")

    ur_rtde.RTDEReceiveInterface = refuse
    with pytest.raises(ConnectionError, match="protocol version"):
        rtde_connector(timeout=60.0)("127.0.0.1", 125.0)


OUTPUTS = ["timestamp", "actual_TCP_pose", "actual_q", "actual_qd", "actual_TCP_force"]


def ask(port: int, timeout: float = 60.0) -> None:
    require_outputs("127.0.0.1", port, OUTPUTS, 125.0, timeout)


@pytest.mark.parametrize("before", [b"", b"\x00\x08Mhello"], ids=["outputs", "a text message, then outputs"])
def test_a_controller_that_gives_the_outputs(listen, before):
    ask(listen(lambda client: (client.sendall(before), faulty("")(client))))


def saying(words):
    def treat(client) -> None:
        client.sendall(words)
        while client.recv(100):
            pass

    return treat


@pytest.mark.parametrize(
    ("treat", "reason", "timeout"),
    [
        (faulty("old protocol"), "refuses protocol 2", 60.0),
        (faulty("unknown output"), "does not give timestamp, actual_TCP_pose", 60.0),
        (faulty("refused start"), "refuses to start", 60.0),
        (saying(b""), "timed out", 0.1),
        (saying(b"\x00\x05V"), "timed out", 0.1),
        (saying(b"HTTP/1.1 400 Bad Request\r\n\r\n"), "does not speak RTDE", 60.0),
        (saying(b"\x00\x01V"), "does not speak RTDE", 60.0),
        (saying(b"\x00\x04V\x01\x00\x0aO\x01DOUBLE"), "does not give timestamp", 60.0),
        (lambda client: client.recv(100), "closed the connection", 60.0),
    ],
)
def test_what_gives_no_outputs_is_named_with_the_reason(listen, treat, reason, timeout):
    port = listen(treat)
    with pytest.raises(ConnectionError, match=f"no RTDE at 127.0.0.1:{port}: .*{reason}"):
        ask(port, timeout)


def test_a_pose_is_a_position_and_axis_times_angle():
    poses = [[0.1, -0.2, 0.3, 0.0, 0.0, np.pi / 2], [0.4, 0.0, 0.2, np.pi, 0.0, 0.0]]
    upright, down = transform_from_rtde(poses)
    np.testing.assert_allclose(upright[:3], [[0, -1, 0, 0.1], [1, 0, 0, -0.2], [0, 0, 1, 0.3]], atol=1e-15)
    # rx = pi, as the teach pendant shows it: z of the tool points to the floor, x stays
    np.testing.assert_allclose(down[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-15)
    np.testing.assert_allclose(BASE_LINK_FROM_BASE, np.diag([-1.0, -1.0, 1.0, 1.0]), atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-4, 1.0, np.pi - 1e-9, np.pi, 1.5 * np.pi])
def test_any_angle_gives_a_rotation_of_that_angle(angle):
    rotation = transform_from_rtde([0, 0, 0, *(angle * np.array([0.6, 0.0, 0.8]))])[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    expected = np.pi - abs(angle % (2 * np.pi) - np.pi)
    assert se3.rotation_angle(rotation) == pytest.approx(expected, abs=1e-8)


def test_tcp_offset_is_taken_off():
    rng = np.random.default_rng(1)
    tool, offset = rng.uniform(-1, 1, 6), np.array([0.0, 0.01, 0.12, 0.0, 0.3, 0.0])
    tcp = transform_from_rtde(tool) @ transform_from_rtde(offset)
    recovered = tool_from_tcp(np.concatenate([tcp[:3, 3], se3.log(tcp)[3:]]), offset)
    np.testing.assert_allclose(recovered, transform_from_rtde(tool), atol=1e-12)


@pytest.mark.parametrize(
    ("pose", "message"),
    [([0.0] * 7, "6 values"), ([np.nan, 0, 0, 0, 0, 0], "non-finite"), ([np.inf] * 6, "non-finite")],
)
def test_bad_poses_are_refused(pose, message):
    with pytest.raises(InputError, match=message):
        transform_from_rtde(pose)


START = 1_700_000_000 * SECOND


def test_polling_delay_is_taken_out():
    rng = np.random.default_rng(0)
    clock, errors = RobotClock(), []
    for k in range(2000):
        robot = 100.0 + k * 0.002
        measured = START + k * 2_000_000
        arrival = measured + 300_000 + round(rng.exponential(3e6))  # 0.3 ms transport, then jitter
        errors.append((stamp := clock.stamp(robot, arrival)) - measured)
        assert stamp <= arrival
    settled = np.array(errors[200:])
    # what stays is the least delay; the jitter (3 ms) is gone
    assert settled.min() >= 300_000
    assert settled.max() < 400_000


def test_drift_is_followed():
    clock = RobotClock(window_s=2.0)
    for k in range(20_000):  # 160 s at 100 ppm: 16 ms apart at the end
        arrival = START + round(k * 8_000_000 * (1 + 100e-6))
        stamp = clock.stamp(k * 0.008, arrival)
    assert abs(stamp - arrival) < 250_000


def test_a_step_of_our_clock_is_forgotten_after_the_window():
    clock = RobotClock(window_s=1.0)
    for k in range(1000):
        step = 500_000_000 if k >= 500 else 0
        arrival = START + k * 8_000_000 + step
        stamp = clock.stamp(k * 0.008, arrival)
    assert stamp == arrival


def test_a_restarted_controller_starts_over():
    clock = RobotClock()
    clock.stamp(5000.0, START)
    assert clock.stamp(1.0, START + 60 * SECOND) == START + 60 * SECOND
