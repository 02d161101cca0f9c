"""Progress bars on stderr: live on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys
import weakref

from tqdm import tqdm

_LOG_INTERVAL_S = 10.0
_bars: weakref.WeakSet[tqdm] = weakref.WeakSet()


def progress_bar(**options) -> tqdm:
    """A `tqdm` bar with its options; where stderr is no terminal it is written every ten seconds only."""
    live = sys.stderr.isatty()
    bar = tqdm(mininterval=0.1 if live else _LOG_INTERVAL_S, maxinterval=_LOG_INTERVAL_S, **options)
    _bars.add(bar)
    return bar


def close_bars() -> None:
    """Close the bars that an error has left open, so that what is printed about it begins a line."""
    for bar in list(_bars):
        bar.close()
