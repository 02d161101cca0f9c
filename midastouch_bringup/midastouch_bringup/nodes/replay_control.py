"""How a replay is controlled from outside: services for pause and steps, run-time parameters for pace and place."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from ..playback import Playback


class ReplayControl:
    """Adds `~/pause`, `~/resume` and `~/step` to a node and carries changes of `rate` and `seek_to` to the playback."""

    def __init__(self, node: Node, playback: Playback):
        self._playback = playback
        node.create_service(Trigger, "~/pause", self._pause)
        node.create_service(Trigger, "~/resume", self._resume)
        node.create_service(Trigger, "~/step", self._step)
        node.add_post_set_parameters_callback(self._on_parameters)

    def _on_parameters(self, changes: list[Parameter]) -> None:
        for change in changes:
            if change.name == "rate":
                self._playback.set_rate(change.value)
            elif change.name == "seek_to":
                self._playback.seek(change.value)

    def _pause(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._playback.pause()
        response.success, response.message = True, "paused"
        return response

    def _resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._playback.resume()
        response.success, response.message = True, "playing"
        return response

    def _step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._playback.step()
        response.message = "one frame" if response.success else "not paused; call pause first"
        return response
