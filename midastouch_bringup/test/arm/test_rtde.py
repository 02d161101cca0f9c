import contextlib
import socket
import sys
import threading
import types
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rtde_server import serve

from midastouch_bringup.arm import rtde_receiver
from midastouch_common.errors import InputError


class FakeInterface:
    """Answers like ur-rtde's RTDEReceiveInterface."""

    def __init__(self, robot_ip, rate, outputs):
        self.arguments, self.connected = (robot_ip, rate, tuple(outputs)), True

    def isConnected(self):
        return self.connected

    def getTimestamp(self):
        return 12.5

    def getActualTCPPose(self):
        return [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]

    def getActualQ(self):
        return [0.1] * 6

    def getActualQd(self):
        return [0.2] * 6

    def disconnect(self):
        self.connected = False


@pytest.fixture
def ur_rtde(monkeypatch):
    module = types.ModuleType("rtde_receive")
    module.RTDEReceiveInterface = FakeInterface
    monkeypatch.setitem(sys.modules, "rtde_receive", module)
    return module


def serve_next(server):
    with contextlib.suppress(OSError):
        client, _ = server.accept()
        with client:
            serve(client, "")


@pytest.fixture
def controller(monkeypatch):
    """A server that speaks RTDE, on a port in the place of the controller's."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setattr(rtde_receiver, "RTDE_PORT", server.getsockname()[1])
        thread = threading.Thread(target=serve_next, args=[server], daemon=True)
        thread.start()
        yield server


def test_missing_package_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "rtde_receive", None)
    with pytest.raises(InputError, match="pip install ur-rtde"):
        rtde_receiver.rtde_connector()


def test_state_is_read_until_the_connection_is_lost(ur_rtde, controller):
    arm = rtde_receiver.rtde_connector(timeout=60.0)("127.0.0.1", 125.0)
    state = arm.read()
    assert state.robot_time == 12.5
    np.testing.assert_array_equal(state.tcp_pose, [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(state.positions, [0.1] * 6)
    np.testing.assert_array_equal(state.velocities, [0.2] * 6)
    arm.close()
    assert arm.read() is None


def test_a_state_is_never_put_together_from_two(ur_rtde, controller):
    """The library's thread puts in the next one while this one is read."""

    class Hurried(FakeInterface):
        time, calls = 10.0, 0

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

    ur_rtde.RTDEReceiveInterface = Hurried
    state = rtde_receiver.rtde_connector(timeout=60.0)("127.0.0.1", 125.0).read()
    assert state.robot_time == pytest.approx(10.016)
    assert set(state.tcp_pose) == set(state.positions) == {state.robot_time}


def test_an_arm_that_does_not_answer_is_named(ur_rtde, monkeypatch):
    connect = rtde_receiver.rtde_connector(timeout=0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    monkeypatch.setattr(rtde_receiver, "RTDE_PORT", port)
    with pytest.raises(ConnectionError, match=f"127.0.0.1:{port}"):
        connect("127.0.0.1", 125.0)


def test_a_refusal_of_the_library_is_a_connection_error(ur_rtde, controller):
    def refuse(*_):
        raise RuntimeError("protocol version 2 not accepted")

    ur_rtde.RTDEReceiveInterface = refuse
    with pytest.raises(ConnectionError, match="protocol version"):
        rtde_receiver.rtde_connector(timeout=60.0)("127.0.0.1", 125.0)
