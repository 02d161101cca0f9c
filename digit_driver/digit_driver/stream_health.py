"""Verdict on a stream, for /diagnostics: OK, WARN or ERROR, the reason, and the figures behind it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

from midastouch_common.clock_offset import ClockOffset

from .frames import Frame, ReaderState, ReaderStatus, SourceInfo
from .stream_monitors import ImageHealth, ImageReport, JitterMonitor, RateMonitor

_SLOW_RATE_FRACTION = 0.9
_LONGEST_SILENCE_S = 3.0
_FROZEN_AFTER_S = 1.0


class Level(IntEnum):
    """Numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class HealthReport:
    """Verdict to publish.

    Attributes:
        level: the worst of all findings.
        message: the findings, worst first.
        values: figures by name, as text.
        uneven: the finding that stamps are not evenly spaced, which no image shows; empty without it.
    """

    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)
    uneven: str = ""


@dataclass(frozen=True)
class StreamEvidence:
    """The measurements that the verdict rests on.

    Attributes:
        reader: the reader's counters.
        rate: measured frames per second, None while unknown.
        backward: stamps that did not advance.
        image: state of the newest image, None before the first.
        jitter: deviation of stamps from even spacing, seconds; None while unknown.
        jitter_limit: largest deviation that is allowed, seconds.
    """

    reader: ReaderStatus
    rate: float | None
    backward: int
    image: ImageReport | None
    jitter: float | None
    jitter_limit: float


def assess(evidence: StreamEvidence, clock: ClockOffset) -> HealthReport:
    """Return the verdict on one moment."""
    findings = sorted(_findings(evidence), key=lambda finding: -finding[0])
    level = findings[0][0] if findings else Level.OK
    state = evidence.reader.state
    quiet = "capture is off" if state is ReaderState.STOPPED else state.value
    message = "; ".join(text for _, text in findings) or quiet
    return HealthReport(level, message, _values(evidence, clock), _uneven(evidence))


def _findings(evidence: StreamEvidence) -> list[tuple[Level, str]]:
    reader = evidence.reader
    if reader.silent_s > _LONGEST_SILENCE_S:
        return [(Level.ERROR, f"the device driver hangs since {reader.silent_s:.0f} s; replug the sensor")]
    if reader.state in (ReaderState.CONNECTING, ReaderState.DISCONNECTED, ReaderState.FAILED):
        return [(Level.ERROR, f"{reader.state.value}: {reader.last_error or 'opening the camera'}")]
    if reader.state is not ReaderState.STREAMING:
        return []
    findings = [(Level.WARN, warning) for warning in reader.info.warnings]
    if evidence.rate is not None and evidence.rate < _SLOW_RATE_FRACTION * reader.info.fps:
        findings.append((Level.WARN, f"{evidence.rate:.1f} frames/s instead of {reader.info.fps:g}"))
    if evidence.backward:
        findings.append((Level.WARN, f"{evidence.backward} time stamps did not advance"))
    if uneven := _uneven(evidence):
        findings.append((Level.WARN, uneven))
    if evidence.image is not None and evidence.image.problem:
        findings.append((Level.WARN, evidence.image.problem))
    return findings


def _uneven(evidence: StreamEvidence) -> str:
    reader = evidence.reader
    jitter = evidence.jitter if reader.state is ReaderState.STREAMING else None
    if jitter is None or jitter <= evidence.jitter_limit:
        return ""
    return (
        f"time stamps are uneven by {1e3 * jitter:.1f} ms (limit {1e3 * evidence.jitter_limit:g} ms); "
        "check use_buffer_timestamps and the load of this computer"
    )


def _values(evidence: StreamEvidence, clock: ClockOffset) -> dict[str, str]:
    reader = evidence.reader
    values = {
        "state": reader.state.value,
        "frames": str(reader.frames),
        "lost_frames": str(reader.lost),
        "corrupt_frames": str(reader.corrupt),
        "overwritten_frames": str(reader.overwritten),
        "reconnects": str(reader.reconnects),
        "last_error": reader.last_error,
        "clock_offset_s": f"{clock.offset_ns * 1e-9:.6f}",
        "clock_steps": str(clock.steps),
        "last_clock_step_s": f"{clock.last_step_ns * 1e-9:.6f}",
    }
    if reader.info is not None:
        values["source"] = reader.info.name
        values["expected_fps"] = f"{reader.info.fps:g}"
    if evidence.rate is not None:
        values["fps"] = f"{evidence.rate:.2f}"
    if evidence.jitter is not None:
        values["stamp_jitter_s"] = f"{evidence.jitter:.6f}"
    if evidence.image is not None:
        values["image_mean"] = f"{evidence.image.mean:.1f}"
        values["image_saturated"] = f"{evidence.image.saturated:.3f}"
        values["image_repeats"] = str(evidence.image.repeats)
    return values


class StreamMonitor:
    """Monitor of one stream; used by one thread.

    Parameters
    ----------
    monotonic_ns : the host's monotonic clock [ns]
    offset
        From that clock to wall time.
    """

    def __init__(self, monotonic_ns: Callable[[], int] = time.monotonic_ns, offset: ClockOffset | None = None) -> None:
        self._monotonic_ns = monotonic_ns
        self._offset = offset or ClockOffset()
        self._rate: RateMonitor | None = None
        self._health: ImageHealth | None = None
        self._image: ImageReport | None = None
        self._jitter = JitterMonitor()

    @property
    def frozen(self) -> bool:
        """True while the camera repeats one image."""
        return self._health is not None and self._health.frozen

    def opened(self, info: SourceInfo) -> None:
        """Forget all measurements, because the camera was opened (again)."""
        self._rate = RateMonitor(info.fps, self._monotonic_ns())
        self._health = ImageHealth(round(_FROZEN_AFTER_S * info.fps))
        self._image = None
        self._jitter = JitterMonitor()

    def stamp(self, frame: Frame) -> int:
        """Note a frame and return its time of acquisition in wall time, nanoseconds."""
        self._rate.add(frame.stamp_monotonic_ns)
        self._image = self._health.update(frame.image)
        self._offset.update()
        stamp_ns = self._offset.to_wall_ns(frame.stamp_monotonic_ns)
        self._jitter.add(stamp_ns, frame.sequence)
        return stamp_ns

    def report(self, reader: ReaderStatus, jitter_limit: float) -> HealthReport:
        """Judge the stream as it is now.

        Parameters
        ----------
        reader
        jitter_limit : [s] that stamps may be off even spacing
        """
        rate = self._rate.rate(self._monotonic_ns()) if self._rate else None
        backward = self._rate.backward if self._rate else 0
        evidence = StreamEvidence(reader, rate, backward, self._image, self._jitter.jitter(), jitter_limit)
        return assess(evidence, self._offset)
