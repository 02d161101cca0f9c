"""Control of a replay: services for pause and steps, run-time parameters for pace and position, and keys."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.ros.services import offer

from ..replay.playback import Playback

KEYS_HELP = "space: pause; right: next frame; left: 5 s back; up, down: faster, slower"
_SEEK_BACK_S, _RATE_FACTOR, _HIGHEST_RATE = 5.0, 1.25, 1000.0


class ReplayControl:
    """Services `~/pause`, `~/resume` and `~/step` of a node, and its parameters `rate` and `seek_to`, for a playback.

    position(): of the playback, seconds after the beginning; duration: of the recording, s, beyond which a seek is
    refused.
    """

    def __init__(self, node: Node, playback: Playback, position: Callable[[], float], duration: float):
        self._node, self._playback, self._position, self._duration = node, playback, position, duration
        offer(node, Trigger, "~/pause", self._pause)
        offer(node, Trigger, "~/resume", self._resume)
        offer(node, Trigger, "~/step", self._step)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._on_parameters)

    def keys(self) -> dict[str, Callable[[], object]]:
        """Return the function of each key of `Keyboard`; each logs the state that it leaves."""
        acts: dict[str, Callable[[], object]] = {
            " ": lambda: self._playback.resume() if self._playback.paused else self._playback.pause(),
            "right": lambda: "; one frame" if self._playback.step() else "; space pauses, then right steps",
            "left": lambda: self._set("seek_to", max(0.0, self._position() - _SEEK_BACK_S)),
            "up": lambda: self._change_rate(_RATE_FACTOR),
            "down": lambda: self._change_rate(1 / _RATE_FACTOR),
        }
        return {key: partial(self._press, act) for key, act in acts.items()}

    def _press(self, act: Callable[[], object]) -> None:
        done, state = act() or "", "paused" if self._playback.paused else "playing"
        self._node.get_logger().info(f"{state}, rate {self._node.get_parameter('rate').value:.2f}{done}")

    def _change_rate(self, factor: float) -> None:
        self._set("rate", min(self._node.get_parameter("rate").value * factor, _HIGHEST_RATE))

    def _set(self, name: str, value: float) -> None:
        """Set a parameter, as `ros2 param set` does, so that its value stays true."""
        self._node.set_parameters([Parameter(name, value=value)])

    def _check(self, changes: list[Parameter]) -> SetParametersResult:
        for change in changes:
            if change.name == "seek_to" and change.value > self._duration:
                reason = f"seek_to: {change.value:g} s is beyond the end, the recording is {self._duration:.3f} s long"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _on_parameters(self, changes: list[Parameter]) -> None:
        for change in changes:
            if change.name == "rate":
                self._playback.set_rate(change.value)
            elif change.name == "seek_to":
                self._playback.seek(change.value)

    def _pause(self, _: Trigger.Request) -> str:
        self._playback.pause()
        return "paused"

    def _resume(self, _: Trigger.Request) -> str:
        self._playback.resume()
        return "playing"

    def _step(self, _: Trigger.Request) -> str:
        if not self._playback.step():
            raise InputError("not paused; call pause first")
        return "one frame"
