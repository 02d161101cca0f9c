"""Gates: each recognises work that a scene does not need and counts how often it was skipped (DESIGN 5.5)."""

from __future__ import annotations

import numpy as np

from .config import FilterConfig
from .motion_model import Odometry


class Gate:
    """Counter of skipped work; `skipped` is the number of times. An `open` gate lets everything pass."""

    def __init__(self) -> None:
        self.skipped = 0
        self.open = False

    def count(self, skip: bool) -> bool:
        """Count and return whether to skip."""
        skip = bool(skip) and not self.open
        self.skipped += skip
        return skip


class RestGate(Gate):
    """At rest: no motion, no noise, no measurement, no resampling.

    Small steps add up, so that slow creeping is not lost: the sum is handed on once it exceeds a limit.
    """

    def __init__(self, config: FilterConfig):
        super().__init__()
        self._config = config
        self._pending = np.eye(4)

    def motion(self, odometry: Odometry) -> Odometry | None:
        """All motion since the last that was handed on, or None while it is too small to matter."""
        total = Odometry.from_matrix(self._pending @ odometry.transform)
        moving = total.distance > self._config.update_min_d or total.angle > self._config.update_min_a
        held = self.count(not moving)
        self._pending = total.transform if held else np.eye(4)
        return None if held else total

    def reset(self) -> None:
        """Forget small steps held back, because the particles were drawn anew."""
        self._pending = np.eye(4)


class ContactGate(Gate):
    """No contact: nothing to look up, weigh or resample."""

    def skips(self, in_contact: bool) -> bool:
        return self.count(not in_contact)


class UnchangedCodeGate(Gate):
    """The very same code again: a repeated image, not a new touch."""

    def __init__(self) -> None:
        super().__init__()
        self._last: np.ndarray | None = None

    def skips(self, code: np.ndarray) -> bool:
        same = self._last is not None and np.array_equal(code, self._last)
        self._last = code
        return self.count(same)

    def reset(self) -> None:
        """Forget the last code, so that the next one counts."""
        self._last = None


class EffectiveSizeGate(Gate):
    """Enough particles carry weight: resampling would only lose diversity."""

    def __init__(self, config: FilterConfig):
        super().__init__()
        self._share = config.resample_ess

    def skips(self, effective: float, n: int) -> bool:
        return self.count(effective >= self._share * n)


class OccupiedGate(Gate):
    """Few particles: score only the codebook entries they occupy instead of the whole book."""

    _SHARE = 8  # gathering scattered codes costs several times a streamed one

    def skips(self, n_particles: int, n_entries: int) -> bool:
        return self.count(n_particles * self._SHARE <= n_entries)


class UnmovedGate(Gate):
    """Nothing happened to the particles: the modes are still those of the last step."""

    def skips(self, touched: bool) -> bool:
        return self.count(not touched)


class WideGate(Gate):
    """No mode is narrow enough for its rendered view to tell anything."""

    def skips(self, none_narrow: bool) -> bool:
        return self.count(none_narrow)


class UnrivalledGate(Gate):
    """The last replays refuted every rival of the one mode: the next can wait longer."""

    def skips(self, unrivalled: bool) -> bool:
        return self.count(unrivalled)
