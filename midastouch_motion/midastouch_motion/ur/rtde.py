"""A Universal Robots arm over RTDE, without ROS: states, transforms and the controller's clock."""

from __future__ import annotations

import socket
import struct
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.missing_modules import pip_install

RTDE_PORT = 30004
_OUTPUTS = ["timestamp", "actual_TCP_pose", "actual_q", "actual_qd", "actual_TCP_force"]
# the handshake: Universal Robots, "Real-Time Data Exchange Guide"
_PROTOCOL = 2
_VERSION, _RECIPE, _START, _TEXT = b"V", b"O", b"S", b"M"
_YES = b"\x01"


@dataclass(frozen=True)
class ArmState:
    """One sample of the arm."""

    robot_time: float  # s since the controller's start
    tcp_pose: np.ndarray  # (6,) [x y z rx ry rz], m and rad, of the TCP in `base`
    positions: np.ndarray  # (6,) rad
    velocities: np.ndarray  # (6,) rad/s
    wrench: np.ndarray  # (6,) force and torque on the TCP along the axes of `base`, N and N m, without the payload's


class RtdeReceiver:
    """One connection to an arm."""

    def __init__(self, arm):
        self._arm = arm

    def read(self) -> ArmState | None:
        """Return the newest state, the same again if no new one has arrived; None once the connection is lost."""
        while self._arm.isConnected():
            state = ArmState(
                self._arm.getTimestamp(),
                np.array(self._arm.getActualTCPPose()),
                np.array(self._arm.getActualQ()),
                np.array(self._arm.getActualQd()),
                np.array(self._arm.getActualTCPForce()),
            )
            # the library's thread may have put in the next state between two of these calls
            if self._arm.getTimestamp() == state.robot_time:
                return state
        return None

    def close(self) -> None:
        """End the connection."""
        self._arm.disconnect()


def require_ur_rtde() -> None:
    """Raise InputError, with the command that installs it, if `ur-rtde` is missing."""
    try:
        import rtde_receive  # noqa: F401
    except ImportError as error:
        raise InputError(f"an arm over RTDE needs ur-rtde; install it: {pip_install('ur-rtde')}") from error


def rtde_connector(timeout: float = 2.0) -> Callable[[str, float], RtdeReceiver]:
    """Return a function (robot_ip, rate in Hz) -> RtdeReceiver that raises ConnectionError if the arm is silent.

    Raises InputError if `ur-rtde`, which only arms without a ROS driver need, is not installed.
    """
    require_ur_rtde()
    from rtde_receive import RTDEReceiveInterface

    def connect(robot_ip: str, rate: float) -> RtdeReceiver:
        require_outputs(robot_ip, RTDE_PORT, _OUTPUTS, rate, timeout)
        try:
            return RtdeReceiver(RTDEReceiveInterface(robot_ip, rate, _OUTPUTS))
        except RuntimeError as error:
            raise ConnectionError(f"no RTDE at {robot_ip}:{RTDE_PORT}: {error}") from error

    return connect


#: T_base_link_base, a constant of every UR arm (Universal_Robots_ROS2_Description, `ur_macro.xacro`).
BASE_LINK_FROM_BASE = np.diag([-1.0, -1.0, 1.0, 1.0])

#: Names of the joints in the order of RTDE's `actual_q`.
JOINT_NAMES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)


def transform_from_rtde(pose: np.ndarray) -> np.ndarray:
    """Convert RTDE poses (..., 6) [x y z rx ry rz], metres and radians, to transforms (..., 4, 4).

    Raises InputError on another shape and on non-finite values.
    """
    pose = np.asarray(pose, float)
    if pose.shape[-1:] != (6,):
        raise InputError(f"an RTDE pose has 6 values [x y z rx ry rz], got shape {pose.shape}")
    if not np.isfinite(pose).all():
        raise InputError("RTDE pose with a non-finite value; is the arm powered on and its controller ready?")
    flat = pose.reshape(-1, 6)
    rotation = Rotation.from_rotvec(flat[:, 3:]).as_matrix()
    return se3.make(rotation, flat[:, :3]).reshape((*pose.shape[:-1], 4, 4))


def tool_from_tcp(tcp_pose: np.ndarray, tcp_offset: np.ndarray) -> np.ndarray:
    """Return the pose of the tool flange.

    Parameters
    ----------
    tcp_pose : `actual_TCP_pose` (..., 6)
    tcp_offset : `T_tool0_tcp` (6,)
        The TCP set on the teach pendant, and written as there: [x y z rx ry rz], metres and radians.

    Returns
    -------
    `T_base_tool0` (..., 4, 4)
    """
    return transform_from_rtde(tcp_pose) @ se3.inverse(transform_from_rtde(tcp_offset))


class RobotClock:
    """Map from seconds since the controller's start to nanoseconds of our clock, estimated again with each state.

    A state arrives some transport and polling delay after it was measured, never before. The smallest
    difference (arrival - robot time) of the last `window_s` seconds is therefore the offset between the
    clocks with the least delay in it. The window is short enough for the clocks not to drift apart in it
    (50 ppm are 0.1 ms in 2 s) and forgets steps of either clock.
    """

    def __init__(self, window_s: float = 2.0):
        self._window_ns = round(window_s * 1e9)
        # sliding minimum: (robot time, offset), both ascending
        self._offsets: deque[tuple[int, int]] = deque()
        self._last: int | None = None

    def stamp(self, robot_time_s: float, arrival_ns: int) -> int:
        """Return the time at which a state of the robot was measured.

        Parameters
        ----------
        robot_time_s : time of the state, robot's clock [s]
        arrival_ns : time of its arrival, our clock [ns]

        Returns
        -------
        [ns], our clock
        """
        now = round(robot_time_s * 1e9)
        if self._last is not None and now < self._last:
            self._offsets.clear()  # the controller was restarted
        self._last = now
        offset = arrival_ns - now
        while self._offsets and self._offsets[-1][1] >= offset:
            self._offsets.pop()
        self._offsets.append((now, offset))
        while self._offsets[0][0] < now - self._window_ns:
            self._offsets.popleft()
        return now + self._offsets[0][1]


def require_outputs(address: str, port: int, outputs: Sequence[str], rate: float, timeout: float) -> None:
    """Raise ConnectionError, with the reason, unless a controller answers that would send these outputs.

    Without this handshake, `ur-rtde` waits for minutes, without releasing the interpreter, if nothing answers, and ends
    the whole process if a controller refuses. rate: samples per second; timeout [s] of each answer.
    """
    try:
        with socket.create_connection((address, port), timeout=timeout) as connection:
            _negotiate(connection, outputs, rate)
    except OSError as error:
        raise ConnectionError(f"no RTDE at {address}:{port}: {error}") from error


def _negotiate(connection: socket.socket, outputs: Sequence[str], rate: float) -> None:
    if _ask(connection, _VERSION, struct.pack(">H", _PROTOCOL)) != _YES:
        raise ConnectionError(f"it refuses protocol {_PROTOCOL}; update the controller's software")
    answer = _ask(connection, _RECIPE, struct.pack(">d", rate) + ",".join(outputs).encode())
    # one byte names the recipe; the rest are the outputs' types
    types = answer[1:].decode("ascii", "replace").split(",")
    missing = [name for name, kind in zip(outputs, types, strict=False) if kind in ("NOT_FOUND", "IN_USE")]
    if missing or len(types) != len(outputs):
        raise ConnectionError(f"it does not give {', '.join(missing or outputs)}; update the controller's software")
    if _ask(connection, _START, b"") != _YES:
        raise ConnectionError("it refuses to start sending; is its program being loaded?")


def _ask(connection: socket.socket, letter: bytes, payload: bytes) -> bytes:
    """Return the payload of the answer to a request; text messages that come in between are ignored."""
    connection.sendall(struct.pack(">Hc", 3 + len(payload), letter) + payload)
    while True:
        size, answered = struct.unpack(">Hc", _read(connection, 3))
        if answered not in (letter, _TEXT) or size < 3:
            raise ConnectionError("what answers does not speak RTDE")
        answer = _read(connection, size - 3)
        if answered == letter:
            return answer


def _read(connection: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            raise ConnectionError("it closed the connection")
        data += part
    return data
