"""Progress bars on stderr: live on a terminal, a line now and then in a log."""

from __future__ import annotations

import io
import sys
import threading
import weakref
from typing import Any, TextIO

from tqdm import tqdm

from .text_table import plural

_LIVE_INTERVAL_S, _LOG_INTERVAL_S = 0.1, 5.0
SOON_S = 1.0
"""Time [s] after which a bar appears."""
_ENDLESS = "{desc}: {n_fmt}{unit}, {elapsed}"  # a bar whose total is not known
_bars: weakref.WeakSet[tqdm] = weakref.WeakSet()
tqdm.set_lock(threading.RLock())  # its own is a semaphore of the system, which a process that is ended would leave


def progress_bar(**options) -> tqdm:
    """Return a `tqdm` bar with its options (unit: in the singular), which appears after a second.

    An error in that time is not preceded by a bar. Without a terminal it prints a line every 5 s.
    """
    if unit := options.get("unit", "").replace("B", ""):
        options["unit"] = f" {plural(unit)}"
    if options.get("total") is None and "iterable" not in options:
        options.setdefault("bar_format", _ENDLESS)
    if sys.stderr.isatty():
        bar = _LateBar(mininterval=_LIVE_INTERVAL_S, maxinterval=_LOG_INTERVAL_S, **options)
    else:
        bar = _LateBar(mininterval=_LOG_INTERVAL_S, maxinterval=_LOG_INTERVAL_S, file=_Lines(sys.stderr), **options)
    _bars.add(bar)
    return bar


class _LateBar(tqdm):
    """Bar that is drawn first after `SOON_S`, even if nothing has advanced by then."""

    def __init__(self, **options: Any) -> None:
        super().__init__(delay=SOON_S, **options)
        self._first = threading.Timer(SOON_S, self._show)
        self._first.daemon = True
        if not self.disable:
            self._first.start()

    def _show(self) -> None:
        if not self.disable:  # by `close`
            self.delay = 0.0  # `close` leaves a bar on the terminal only if this is over
            self.refresh()

    def close(self) -> None:
        """Leave the bar as it is, if it was drawn."""
        if first := getattr(self, "_first", None):  # a constructor that fails has none
            first.cancel()
        super().close()


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
