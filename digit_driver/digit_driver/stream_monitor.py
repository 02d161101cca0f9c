"""Everything that is measured on the way from frames to topics: rate, jitter, image health, and the two clocks."""

from __future__ import annotations

from midastouch_common.clock_offset import ClockOffset

from .frame_slot import ReaderStatus
from .frame_source import Frame, MonotonicClock, SourceInfo
from .health_report import Evidence, HealthReport, assess
from .image_health import ImageHealth, ImageReport
from .jitter_monitor import JitterMonitor
from .rate_monitor import RateMonitor

FROZEN_AFTER_S = 1.0


class StreamMonitor:
    """Watches one stream; used by one thread.

    Args:
        clock: the host's monotonic clock.
        offset: its distance to wall time.
    """

    def __init__(self, clock: MonotonicClock | None = None, offset: ClockOffset | None = None) -> None:
        self._clock = clock or MonotonicClock()
        self._offset = offset or ClockOffset()
        self._rate: RateMonitor | None = None
        self._health: ImageHealth | None = None
        self._image: ImageReport | None = None
        self._jitter = JitterMonitor()

    def opened(self, info: SourceInfo) -> None:
        """The camera was opened (again): what was measured before is forgotten."""
        self._rate = RateMonitor(info.fps, self._clock.now_ns())
        self._health = ImageHealth(round(FROZEN_AFTER_S * info.fps))
        self._image = None
        self._jitter = JitterMonitor()

    def stamp(self, frame: Frame) -> int:
        """Takes note of a frame and returns its acquisition in wall time, nanoseconds."""
        self._rate.add(frame.stamp_monotonic_ns)
        self._image = self._health.update(frame.image)
        self._offset.update()
        stamp_ns = self._offset.to_wall_ns(frame.stamp_monotonic_ns)
        self._jitter.add(stamp_ns, frame.sequence)
        return stamp_ns

    def report(self, reader: ReaderStatus, jitter_limit: float) -> HealthReport:
        """The verdict on the stream now; stamps may be ``jitter_limit`` seconds off even spacing."""
        rate = self._rate.rate(self._clock.now_ns()) if self._rate else None
        backward = self._rate.backward if self._rate else 0
        evidence = Evidence(reader, rate, backward, self._image, self._jitter.jitter(), jitter_limit)
        return assess(evidence, self._offset)
