"""Services that an explorer calls: where to touch next, and another object under the finger."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.task import Future

from midastouch_msgs.srv import SetObject, SuggestMotion

_TIMEOUT_S = 10.0  # with an answer that takes a tenth of a second


class SuggestionClient:
    """Asks one question at a time. on_answer: called with each response; on_silence: with words, if there is none."""

    def __init__(
        self, node: Node, on_answer: Callable[[SuggestMotion.Response], None], on_silence: Callable[[str], None]
    ):
        self._client = node.create_client(SuggestMotion, "suggest_motion")
        self._on_answer, self._on_silence = on_answer, on_silence
        self._asked_at, self._future = 0.0, None

    @property
    def ready(self) -> bool:
        """Whether somebody offers the service."""
        return self._client.service_is_ready()

    @property
    def pending(self) -> bool:
        """Whether an answer is still to come."""
        return self._future is not None

    def ask(self, request: SuggestMotion.Request) -> None:
        """Send the question."""
        self._asked_at = time.monotonic()
        self._future = self._client.call_async(request)
        self._future.add_done_callback(self._on_done)

    def look(self) -> None:
        """Give up waiting for an answer that is overdue; call this regularly."""
        if self.pending and time.monotonic() - self._asked_at > _TIMEOUT_S:
            self._client.remove_pending_request(self._future)
            self._future = None
            self._on_silence(f"no answer of suggest_motion for {_TIMEOUT_S:g} s")

    def _on_done(self, future: Future) -> None:
        if future is self._future:  # else it comes too late
            self._future = None
            self._on_answer(future.result())


class ObjectChange:
    """Calls the two services `set_object`, one after the other, for a node that is spun.

    on_end(mesh_path, why_not) is called after each change, with an empty text if both have taken the object. `pending`:
    whether one is going on.
    """

    def __init__(self, node: Node, on_end: Callable[[str, str], None]):
        self._on_end, self.pending = on_end, False
        self._services = [node.create_client(SetObject, name) for name in ("digit_sim/set_object", "set_object")]

    def begin(self, request: SetObject.Request) -> None:
        """Change the object to the mesh of a request."""
        self.pending = True
        self._call(request, 0)

    def _call(self, request: SetObject.Request, number: int) -> None:
        service = self._services[number]
        if not service.service_is_ready():
            self._end(request, f"nobody offers {service.srv_name}")
            return
        service.call_async(request).add_done_callback(lambda future: self._on_answer(request, number, future))

    def _on_answer(self, request: SetObject.Request, number: int, future: Future) -> None:
        response: SetObject.Response = future.result()
        if not response.success:
            self._end(request, response.message)
        elif number + 1 < len(self._services):
            self._call(request, number + 1)
        else:
            self._end(request, "")

    def _end(self, request: SetObject.Request, why_not: str) -> None:
        self.pending = False
        self._on_end(request.mesh_path, why_not)
