"""Service `capture_background`: makes a no-contact image from the next images."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.task import Future
from std_srvs.srv import Trigger

from midastouch_common.ros.graph_watch import why_silent
from midastouch_common.ros.managed_node import INACTIVE, ManagedNode

from ..tdn.background import BackgroundCapture


class CaptureService:
    """Service of a node with the parameters `background_frames`, `still_threshold` and `capture_timeout`.

    Args: refusal, called with a captured image (H, W, 3) uint8, returns the reason to refuse it or ""; accept, called
    with an image that is not refused, returns a message about its use.
    """

    def __init__(self, node: ManagedNode, refusal: Callable[[np.ndarray], str], accept: Callable[[np.ndarray], str]):
        self._node, self._refusal, self._accept = node, refusal, accept
        self._capture: BackgroundCapture | None = None
        self._answer: Future | None = None
        # A group of its own, so that images get through while the service waits for them.
        group = ReentrantCallbackGroup()
        node.create_service(Trigger, "capture_background", self._on_request, callback_group=group)

    def observe(self, image: np.ndarray) -> None:
        """Take one more image (H, W, 3) uint8 of the sensor."""
        if self._capture is None:
            return
        self._capture.add(image)
        if self._capture.done:
            captured = self._capture.image
            refusal = self._capture.refusal or self._refusal(captured)
            self._finish(not refusal, refusal or self._accept(captured))

    def refuse(self, reason: str) -> None:
        """End a capture that is under way as failed, with a reason."""
        if self._capture is not None:
            self._finish(False, reason)

    def _finish(self, success: bool, message: str) -> None:
        self._capture = None
        self._answer.set_result((success, message))

    async def _on_request(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._node.active or self._capture is not None:
            response.message = "a capture is already under way" if self._node.active else INACTIVE
            return response
        parameters = self._node.parameters
        self._capture = BackgroundCapture(parameters["background_frames"], parameters["still_threshold"])
        self._answer = Future(executor=self._node.executor)
        timeout = parameters["capture_timeout"]
        timer = self._node.create_timer(
            timeout, lambda: self._on_timeout(timeout), clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        response.success, response.message = await self._answer
        self._node.destroy_timer(timer)
        return response

    def _on_timeout(self, timeout: float) -> None:
        if self._capture is None:
            return
        came = f"image_raw: {self._capture.count} of {self._capture.frames} images came within {timeout:g} s"
        fix = "raise capture_timeout" if self._capture.count else why_silent(self._node, "image_raw")
        self._finish(False, f"{came}; {fix}")
