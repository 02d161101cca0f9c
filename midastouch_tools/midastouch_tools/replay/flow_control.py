"""Stop and wait: a replay's next image goes out once the filter has the one before; nothing is sent twice."""

from __future__ import annotations

from collections.abc import Callable

from .playback import Playback

_POLL_S = 0.2  # between checks that the filter is still there
_TICK_S = 0.01


class FlowControl:
    """Flow control that follows each frame to the filter and back.

    `sent` and the waits belong to the thread that plays, `on_status` and `on_report` to the one that listens.

    Args: timeout_reports: number of health reports of the filter after which a frame that it has not mentioned is given
    up; a busy filter reports nothing, so it does not time out. there(): True while there is a filter.
    on_lost: called with the stamp [ns] of each frame that is given up, and the reason. Attribute: lost: number of
    frames that the filter never mentioned.
    """

    def __init__(
        self, playback: Playback, timeout_reports: int, there: Callable[[], bool], on_lost: Callable[[int, str], None]
    ) -> None:
        self._playback, self._timeout_reports, self._there, self._on_lost = playback, timeout_reports, there, on_lost
        self._in_flight: int | None = None  # stamp of the frame sent last, until the filter speaks of it
        self._waiting: list[int] = []  # stamps of frames that wait within the filter, in order
        self._given_up: set[int] = set()
        self._reports = 0
        self.lost = 0

    @property
    def waiting(self) -> int:
        """Number of frames that the filter has received but not answered yet."""
        return len(self._waiting)

    def sent(self, stamp_ns: int) -> None:
        """Note that the image of this stamp is about to be sent."""
        with self._playback.changed:
            self._in_flight, self._reports = stamp_ns, 0

    def on_status(self, stamp_ns: int, waits: bool) -> None:
        """Note that the filter has answered the frame of this stamp or, if `waits`, that the frame waits there."""
        with self._playback.changed:
            self._reports = 0
            if stamp_ns in self._given_up:
                self._given_up.remove(stamp_ns)
                self.lost -= 1
            newest = stamp_ns == self._in_flight
            if newest:
                self._in_flight = None
            if waits:
                self._waiting += [stamp_ns] if newest else []
            elif newest:
                self._waiting.clear()
            elif stamp_ns in self._waiting:  # answers come in order
                del self._waiting[: self._waiting.index(stamp_ns) + 1]
            self._playback.changed.notify_all()

    def on_report(self) -> None:
        """Note that the filter has reported its health, and that it is at work."""
        with self._playback.changed:
            self._reports += 1
            self._playback.changed.notify_all()

    def wait(self) -> bool:
        """Wait until the filter has the frame sent last, or that frame is given up; return False if interrupted."""
        while not self._playback.wait_for(lambda: self._in_flight is None, _POLL_S):
            if self._playback.interrupted:
                return False
            if self._reports >= self._timeout_reports:
                self._give_up(
                    "though the filter is at work: was the image refused (see /diagnostics), or is a node gone?"
                )
            elif not self._there():
                self._give_up("and the filter is gone")
        return True

    def _give_up(self, why: str) -> None:
        with self._playback.changed:
            stamp, self._in_flight = self._in_flight, None
            if stamp is None:
                return
            self._given_up.add(stamp)
            self.lost += 1
        self._on_lost(stamp, why)

    def finish(self, pass_time: Callable[[], None]) -> None:
        """Wait, at the end of a recording, until the filter has given up frames whose transforms cannot come any more.

        pass_time(), called meanwhile, advances the time of the recording.
        """
        if not self.wait():
            return
        self._reports = 0
        while not self._playback.wait_for(lambda: not self._waiting, _TICK_S):
            if self._playback.interrupted or self._reports >= self._timeout_reports or not self._there():
                return
            pass_time()

    def forget(self) -> None:
        """Stop waiting for all frames that were sent, because the recording starts again."""
        with self._playback.changed:
            self._in_flight = None
            self._waiting.clear()
            self._given_up.clear()
