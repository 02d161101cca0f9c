"""One frame in flight at a time: a replay waits for the filter's answer to each, and sends again what got none."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from .look_ahead import LookAhead
from .messages import Message, header_stamp_ns
from .playback import Playback

# The first frame may be lost between two other nodes that have not found each other yet. That the filter sees it
# twice does no harm: it answers a stamp it knows at once.
_FIRST_TIMEOUT_S = 2.0
_AHEAD_NS = 3_000_000_000  # of transforms over an image that waits in vain; a filter keeps 10 s
_PATIENCE_S, _PATIENCE_TIMES, _BETWEEN_S = 0.5, 5.0, 0.02


class FrameAnswers:
    """Waits for answers, which come through `playback.acknowledge`.

    Args: timeout [s] of an answer, after which the frame is sent again; attempts, after which it is given up; send, of
    a message whose turn it is; send_ahead, of transforms whose turn it is not, so that no clock may follow them; warn,
    in words. Attributes: repeated, lost: frames sent again, frames given up.
    """

    def __init__(
        self,
        playback: Playback,
        timeout: float,
        attempts: int,
        send: Callable[[Message], None],
        send_ahead: Callable[[Message], None],
        warn: Callable[[str], None],
    ):
        self._playback, self._timeout, self._attempts = playback, timeout, attempts
        self._send, self._send_ahead, self._warn = send, send_ahead, warn
        self._first = True
        self._usual_s = 0.0  # from a frame to its answer
        self.repeated = self.lost = 0

    def wait(self, frame: Sequence[Message], ahead: LookAhead) -> None:
        """Return once `frame`, the messages since the last image up to its own, is answered, or is given up."""
        stamp = header_stamp_ns(frame[-1].data)
        timeout, attempts, first = self._timeout, self._attempts, self._first
        self._first = False
        if first and timeout > _FIRST_TIMEOUT_S:
            attempts = math.ceil(attempts * timeout / _FIRST_TIMEOUT_S)
            timeout = _FIRST_TIMEOUT_S
        for attempt in range(1, attempts + 1):
            sent = time.monotonic()
            if attempt > 1 or first:
                answered = self._playback.wait_for_acknowledgement(stamp, timeout)
            else:
                answered = self._answered_soon(frame[-1], stamp, timeout, ahead)
            if answered and not first:  # which has waited for compilers
                self._usual_s = max(time.monotonic() - sent, 0.5 * self._usual_s)
            if answered or self._playback.interrupted:
                return
            self._warn(f"no answer to the frame at {stamp / 1e9:.3f} s (attempt {attempt})")
            if attempt < attempts:
                self.repeated += 1
                for message in frame:
                    self._send(message)
        self.lost += 1

    def _answered_soon(self, image: Message, stamp: int, timeout: float, ahead: LookAhead) -> bool:
        """Whether the answer comes in a few times the usual time; the transforms that it may lack are sent meanwhile.

        A filter waits for transforms around an image, and we for the filter: in a gap of the transforms, and before the
        first, those that follow go out ahead of their turn. Where there are none, the frame is soon sent again: a
        filter that has it already says so, though it has to wait.
        """
        patience = min(timeout, max(_PATIENCE_S, _PATIENCE_TIMES * self._usual_s))
        while not self._playback.wait_for_acknowledgement(stamp, patience):
            transform = None if self._playback.interrupted else ahead.transform(image.stamp_ns + _AHEAD_NS)
            if transform is None:
                return False
            self._send_ahead(transform)
            patience = min(patience, _BETWEEN_S)
        return True
