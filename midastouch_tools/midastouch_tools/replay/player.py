"""Player of a recording: each message is sent once and in order, an image once the filter has the one before."""

from __future__ import annotations

from collections.abc import Callable

from ..bags.messages import Message, header_stamp_ns
from ..text_table import counted
from .flow_control import FlowControl
from .playback import Playback
from .source import ReplaySource, is_image

MOST_AFTER_AN_IMAGE = 50  # messages while the filter is busy with it: a subscriber of TF keeps 100
_PASS_NS = 100_000_000  # step of the time after the end, when some frames may still wait for their time-out


class Player:
    """Player that sends the messages of a source when they are due.

    awaits_answers: True if a filter answers the images; send(message): sends it; tell(ns): gets the recorded time as
    it advances. Attributes: frames_sent; frames_repeated: with a stamp that came before in the same round, as the
    recording holds them twice.
    """

    def __init__(
        self,
        source: ReplaySource,
        playback: Playback,
        flow: FlowControl,
        awaits_answers: bool,
        send: Callable[[Message], None],
        tell: Callable[[int], None],
    ):
        self._source, self._playback, self._flow = source, playback, flow
        self._awaits_answers, self._send, self._tell = awaits_answers, send, tell
        self.frames_sent = self.frames_repeated = 0
        self._reached = 0  # newest time, ns
        self._begin = (0.0, 0)  # of this round: s after the beginning, and the stamp there, ns

    @property
    def frames_lost(self) -> int:
        """Number of frames that the filter neither answered nor reported as waiting."""
        return self._flow.lost

    @property
    def frames_broken(self) -> int:
        """Number of frames left out because the recording does not hold their whole image."""
        return self._source.images_broken

    @property
    def position(self) -> float:
        """Recorded time that is reached, in seconds after the beginning of the recording."""
        offset, stamp = self._begin
        return offset + max(0, self._reached - stamp) / 1e9

    def play(self, loops: Callable[[], bool]) -> None:
        """Play to the end, and again while `loops()`, until the playback is stopped; after a seek, play from there on.

        Raises InputError if the source cannot be read.
        """
        offset = 0.0
        while not self._playback.stopped:
            self._playback.rewind()
            self._flow.forget()
            self._reached, self._begin = 0, (offset, 0)
            self._play_round(offset)
            self._playback.wait_while_paused()  # a seek is still possible at the end
            self._flow.finish(lambda: self._tick(self._reached + _PASS_NS))
            sought = self._playback.take_seek()
            if sought is None and not loops():
                return
            offset = sought or 0.0

    def summary(self) -> str:
        """Return the numbers of frames in words."""
        text = f"sent {counted(self.frames_sent, 'frame')}, {self.frames_repeated} repeated, {self.frames_lost} lost"
        if self.frames_broken:
            text += f", {self.frames_broken} left out as their images are broken"
        if self._flow.waiting:
            text += f"; {self._flow.waiting} still wait for a transform that the recording does not hold"
        return text

    def _play_round(self, offset: float) -> None:
        """Send everything from `offset` [s] on, or until interrupted."""
        stamps: set[int] = set()
        after_image, stepping = 0, False
        try:
            for message in self._source.messages(round(offset * 1e9)):
                # A latched message may be from the time that is left out: neither pace nor clock begin there.
                if message.latched:
                    self._send(message)
                    continue
                image = is_image(message.topic)
                must_wait = image or after_image >= MOST_AFTER_AN_IMAGE or self._playback.paused
                if must_wait and not self._flow.wait():
                    return
                # A step ends when its frame is answered, which may take transforms that were recorded after the image.
                if stepping and (image or not self._flow.waiting):
                    self._playback.frame_sent()
                    stepping = False
                if not self._playback.wait_until_due(message.stamp_ns, self._tick):
                    return
                if self._reached == 0:
                    self._begin = (offset, message.stamp_ns)
                after_image += 1
                if image:
                    stamp = header_stamp_ns(message.data)
                    if self._awaits_answers:
                        self._flow.sent(stamp)
                    self.frames_repeated += stamp in stamps
                    stamps.add(stamp)
                    after_image, stepping = 0, True
                    self.frames_sent += 1
                self._tick(message.stamp_ns)
                self._send(message)
        finally:
            if stepping:
                self._playback.frame_sent()

    def _tick(self, recorded_ns: int) -> None:
        """Pass on the recorded time; messages out of order do not turn it back."""
        if recorded_ns > self._reached:
            self._reached = recorded_ns
            self._tell(recorded_ns)
