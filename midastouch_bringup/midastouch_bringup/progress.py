"""Progress bars on stderr: live on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys

from tqdm import tqdm

_LOG_INTERVAL_S = 10.0


def progress_bar(**options) -> tqdm:
    """A `tqdm` bar with its options; where stderr is no terminal it is written every ten seconds only."""
    live = sys.stderr.isatty()
    return tqdm(mininterval=0.1 if live else _LOG_INTERVAL_S, maxinterval=_LOG_INTERVAL_S, **options)
