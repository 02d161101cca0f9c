"""The two ends of a recording, between which nothing is missed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from rclpy.executors import Executor

from ..bags.run_record import CODE, MODES, PARTICLES, PENETRATION, STATUS
from ..nodes.recorder import Recorder
from ..processes.supervisor import NodeFailed

RESULTS = (CODE, PENETRATION, MODES, PARTICLES, STATUS)
"""What the nodes of a run add to a bag."""

_SILENCE_S = 120.0
_ON_THEIR_WAY_S = 0.5


def await_recorder(
    recorder: Recorder, topics: Sequence[str], turn: Callable[[], bool], others: Callable[[], str] = str
) -> bool:
    """Return whether the recorder hears all the topics now: a frame sent earlier would be lost.

    turn: spins once, and tells whether to wait on. others: who else is awaited, in words, if any. Raises NodeFailed
    after two minutes.
    """
    started = time.monotonic()
    while waiting := others() or ", ".join(recorder.unheard(topics)):
        if not turn():
            return False
        if time.monotonic() - started > _SILENCE_S:
            raise NodeFailed(f"still waiting for {waiting} after {_SILENCE_S:g} s; see the logs in the output folder")
    return True


def hear_the_last(executor: Executor) -> None:
    """Spin a while: what the nodes have sent may still be on its way to the recorder."""
    quiet_until = time.monotonic() + _ON_THEIR_WAY_S
    while time.monotonic() < quiet_until:
        executor.spin_once(timeout_sec=0.05)
