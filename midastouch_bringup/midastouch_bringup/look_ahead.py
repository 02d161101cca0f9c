"""The messages of a replay, from which transforms can be taken before it is their turn."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from .messages import TF_TOPIC, Message


class LookAhead:
    """An iterator over `messages` without those that `transform` has taken out."""

    def __init__(self, messages: Iterator[Message]) -> None:
        self._messages = messages
        self._held: deque[Message] = deque()

    def __iter__(self) -> LookAhead:
        return self

    def __next__(self) -> Message:
        return self._held.popleft() if self._held else next(self._messages)

    def transform(self, until_ns: int) -> Message | None:
        """Take out the next moving transforms of a stamp up to `until_ns`; None: there are none."""
        for i, message in enumerate(self._held):
            if message.topic == TF_TOPIC and message.stamp_ns <= until_ns:
                del self._held[i]
                return message
        while not self._held or self._held[-1].stamp_ns <= until_ns:
            message = next(self._messages, None)
            if message is None:
                return None
            if message.topic == TF_TOPIC and message.stamp_ns <= until_ns:
                return message
            self._held.append(message)
        return None
