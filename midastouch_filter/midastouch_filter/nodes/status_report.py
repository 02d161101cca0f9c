"""Status of the filter node, on its own topic and in the diagnostics."""

from __future__ import annotations

import dataclasses

from midastouch_common.ros import diagnostics

from ..core.estimate import Estimate
from ..core.state import LOST, STALE, UNINITIALISED, WAITING, Status
from ..loaded_object import RunningFilter
from ..localiser import Localiser
from .estimate_publisher import EstimatePublisher, Placed
from .finger_topics import FingerTopics


class StatusReport:
    """Publisher of a status for every code; it keeps the last one, and can report in between that an answer is awaited.

    Attributes: counts of what the node itself left out; each status lists them with those of the filter, the
    fingers and the publishers.

    Args: out; fingers; localiser: of the object, whose `coarse` every reason ends with.
    """

    def __init__(self, out: EstimatePublisher, fingers: FingerTopics, localiser: Localiser):
        self.counts = {"transform_timeout": 0, "out_of_order": 0, "odd_stamps": 0, "time_jumps": 0, "no_map": 0}
        self._out, self._fingers, self._localiser = out, fingers, localiser
        self.forget()

    def forget(self) -> None:
        """Drop the numbers of the last step, because the object was changed."""
        self._last = Status(UNINITIALISED, "")

    def say(self, stamp: int, state: str, reason: str) -> None:
        """Publish a state that no step of the filter made; its other numbers are those of the last step."""
        self._last = dataclasses.replace(self._last, state=state, reason=reason, ms={})
        self.say_again(stamp)

    def say_again(self, stamp: int) -> None:
        """Publish the last state again, at `stamp` [ns]."""
        self._out.status(stamp, self._complete(self._last))

    def wait(self, stamp: int, reason: str) -> None:
        """Publish that the answer to `stamp` [ns] is still to come; the state stays what it was."""
        self._out.status(stamp, self._complete(dataclasses.replace(self._last, state=WAITING, reason=reason, ms={})))

    def estimate(self, stamp: int, estimate: Estimate, running: RunningFilter, placed: Placed) -> None:
        """Publish the answer of a step; arguments as for `EstimatePublisher.estimate`."""
        self._last = estimate.status
        complete = dataclasses.replace(estimate, status=self._complete(estimate.status))
        self._out.estimate(stamp, complete, running, placed)

    def describe(self) -> tuple[bytes, str, dict]:
        """Return level, message and values for the diagnostics."""
        s = self._complete(self._last)
        level = diagnostics.WARN if s.state in (STALE, LOST, UNINITIALISED) else diagnostics.OK
        values = {"state": s.state, "n_particles": s.n_particles, "ess": f"{s.ess:.0f}", **s.skipped}
        values |= {f"{name}_ms": f"{ms:.2f}" for name, ms in s.ms.items()}
        if s.symmetry:
            values["symmetry"] = s.symmetry
        return level, f"{s.state}: {s.reason}", values

    def _complete(self, status: Status) -> Status:
        skipped = {**status.skipped, **self.counts, **self._out.skipped, **self._fingers.counts}
        reason, note = self._fingers.qualify(status.reason), self._localiser.coarse
        reason = f"{reason}; {note}" if note else reason
        return dataclasses.replace(status, skipped=skipped, reason=reason, unknown=self._localiser.unknown)
