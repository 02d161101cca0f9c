"""Progress bars on stderr: live on a terminal, a line now and then in a log."""

from __future__ import annotations

import io
import sys
import weakref
from typing import TextIO

from tqdm import tqdm

_LIVE_INTERVAL_S, _LOG_INTERVAL_S = 0.1, 5.0
_bars: weakref.WeakSet[tqdm] = weakref.WeakSet()


def progress_bar(**options) -> tqdm:
    """Return a `tqdm` bar with its options (unit: in the singular); without a terminal it prints a line every 5 s."""
    if unit := options.get("unit", "").replace("B", ""):
        options["unit"] = f" {unit}es" if unit.endswith(("ch", "ss")) else f" {unit}s"
    if sys.stderr.isatty():
        bar = tqdm(mininterval=_LIVE_INTERVAL_S, maxinterval=_LOG_INTERVAL_S, **options)
    else:
        bar = tqdm(mininterval=_LOG_INTERVAL_S, maxinterval=_LOG_INTERVAL_S, file=_Lines(sys.stderr), **options)
    _bars.add(bar)
    return bar


class Bars:
    """Progress bars for the steps of a job: the bar of a new step replaces the one before."""

    def __init__(self) -> None:
        self._step, self._bar = "", None

    def of(self, step: str, unit: str, total: int | None = None) -> tqdm:
        """Return the bar of the current step; total: None if it is not known."""
        if step != self._step:
            self.close()
            self._step, self._bar = step, progress_bar(desc=step, unit=unit, total=total)
        return self._bar

    def close(self) -> None:
        """Close the bar of the last step."""
        if self._bar is not None:
            self._bar.close()


def close_bars() -> None:
    """Close the bars that an error has left open, so that its message begins a line."""
    for bar in list(_bars):
        bar.close()


class _Lines(io.TextIOBase):
    """Stream that writes each state of a bar as a line: in a log read by lines, a bar would show only at its end."""

    def __init__(self, out: TextIO):
        self._out = out

    @property
    def encoding(self) -> str:  # type: ignore[override] # nobody sets it
        return self._out.encoding

    def write(self, text: str) -> int:
        if line := text.strip():
            self._out.write(f"{line}\n")
            self._out.flush()
        return len(text)
