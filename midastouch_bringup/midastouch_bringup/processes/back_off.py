"""How long to wait before what has died is started again."""

from __future__ import annotations


class BackOff:
    """A pause [s] that is twice as long each time, up to `longest`.

    From the beginning again for what has lived that long.
    """

    def __init__(self, first: float = 2.0, longest: float = 60.0):
        self._first, self._longest = first, longest
        self._next = first

    def after(self, lived: float) -> float:
        """The pause for a process that has died `lived` seconds after its start."""
        delay = self._first if lived >= self._longest else self._next
        self._next = min(2.0 * delay, self._longest)
        return delay
