"""Stand-ins that can be imported, and the handlers of signals."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
# The filter node's stand-ins are beside its own tests.
sys.path.insert(0, str(Path(__file__).parents[3] / "midastouch_filter/test/nodes"))


@pytest.fixture
def heeding_signals() -> Iterator[None]:
    """Puts the handlers of signals back: an executable's `main`, called in this process, leaves them ignored."""
    former = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in former.items():
        signal.signal(number, handler)
