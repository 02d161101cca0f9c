"""Programs in the foreground of a terminal, until they have ended or a signal comes."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence

from .back_off import BackOff
from .process import Process
from .program import Program
from .supervisor import NodeFailed, Supervisor
from .wake_up import woken_by_signals


def run_in_foreground(
    programs: Sequence[Program], environment: Mapping[str, str], respawn: Callable[[], BackOff] | None = None
) -> int:
    """Run programs until SIGINT, SIGTERM, SIGHUP or SIGQUIT arrives, all have ended, or one has died for good.

    In the main thread; returns 1 if one of them died for good, else 0. Their output goes to ours, each line behind the
    name of its program. A second signal while they are being ended does not wait until those that are left have had
    their time. environment, respawn: as of `Supervisor`.
    """
    # what the programs print may be more than our output's encoding holds; one put in its place may be no file
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")
    supervisor = Supervisor(environment, _echo(), respawn)
    with woken_by_signals() as wait:

        def await_ends(left: list[Process], seconds: float) -> None:
            deadline = time.monotonic() + seconds
            while any(process.runs for process in left) and time.monotonic() < deadline:
                if wait(deadline - time.monotonic()):
                    return

        try:
            for program in programs:
                supervisor.start(program)
            while (due := supervisor.look_after()) is not None or supervisor.busy:
                if wait(due):
                    supervisor.say("ending all")
                    break
        except NodeFailed as error:
            supervisor.say(f"{error.cause}; ending all")
            return 1
        finally:
            supervisor.end(await_ends)
    return 0


def _echo() -> Callable[[str, str], None]:
    """Prints lines that come from several threads."""
    one_at_a_time = threading.Lock()

    def echo(name: str, line: str) -> None:
        # nobody may be reading any more; the programs go on
        with one_at_a_time, contextlib.suppress(OSError):
            print(f"[{name}] {line}", flush=True)

    return echo
