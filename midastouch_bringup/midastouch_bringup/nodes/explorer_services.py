"""Client of `suggest_motion` that is never waited for in vain."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.task import Future

from midastouch_msgs.srv import SuggestMotion

_PATIENCE_S = 10.0  # with an answer that takes a tenth of a second


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
        """Give an answer up that has not come in time; to be called now and then."""
        if self.pending and time.monotonic() - self._asked_at > _PATIENCE_S:
            self._client.remove_pending_request(self._future)
            self._future = None
            self._on_silence(f"no answer of suggest_motion for {_PATIENCE_S:g} s")

    def _on_done(self, future: Future) -> None:
        if future is self._future:  # else it comes too late
            self._future = None
            self._on_answer(future.result())
