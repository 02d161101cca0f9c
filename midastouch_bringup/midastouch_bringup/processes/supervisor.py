"""Programs kept running: started together, started again when they die, or ended together."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Mapping

from midastouch_common.errors import EXIT_BAD_INPUT

from .process import Output, Process, Program, end


class BackOff:
    """A pause [s] that is twice as long each time, up to `longest`.

    From the beginning again for what has lived that long.
    """

    def __init__(self, first: float = 2.0, longest: float = 60.0):
        self._first, self._longest = first, longest
        self._next = first

    def after(self, lived: float) -> float:
        """The pause for a process that has died `lived` seconds after its start."""
        delay = self._first if lived >= self._longest else self._next
        self._next = min(2.0 * delay, self._longest)
        return delay


class NodeFailed(RuntimeError):
    """A node died that should have gone on, or falls silent. `cause`: in one line; the message has its last words."""

    def __init__(self, cause: str, last_lines: list[str] | None = None):
        self.cause = cause
        words = "" if last_lines is None else "\n".join(["; its last words:", *last_lines])
        super().__init__(cause + words.replace("\n", "\n  "))


class Supervisor:
    """Starts programs as processes, looks after them, and ends them; `with` ends all.

    environment: of the programs. output: gets what they print, and, in the name `midastouch`, what happens to them.
    respawn: makes the back-off of one program; None: without one of them the others are of no use. One that bad
    input ends is not started again in either case.
    """

    def __init__(self, environment: Mapping[str, str], output: Output, respawn: Callable[[], BackOff] | None = None):
        self._environment, self._output, self._respawn = dict(environment), output, respawn
        self._children: dict[str, _Child] = {}

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(self, program: Program) -> None:
        """Start a program. Raises OSError if it cannot be."""
        child = _Child(program, self._respawn() if self._respawn else None)
        child.process = Process(program, self._environment, self._output)
        self._children[program.name] = child

    def look_after(self) -> float | None:
        """Start those again that are due; returns the seconds until the next one is, None without any.

        Raises NodeFailed if one has died for good.
        """
        for child in self._children.values():
            if child.process is None:
                self._start_again(child)
            elif (status := child.process.status()) is not None:
                self._has_ended(child, status)
        return min((c.due - time.monotonic() for c in self._children.values() if c.due is not None), default=None)

    @property
    def pids(self) -> dict[str, int]:
        """Process ids by name, of those that run or whose end was not yet looked at."""
        return {name: child.process.pid for name, child in self._children.items() if child.process is not None}

    @property
    def busy(self) -> bool:
        """Whether any program runs or is to be started again."""
        return any(child.process is not None or child.due is not None for child in self._children.values())

    def end(self, await_ends: Callable[[list[Process], float], object] | None = None) -> None:
        """End all, as `process.end` does it."""
        running = {name: child.process for name, child in self._children.items() if child.process is not None}
        self._children.clear()
        end(running.values(), await_ends)
        for name, process in running.items():
            status = process.status()
            if status not in (0, -signal.SIGINT):
                self.say(f"{name}: {'would not end' if status is None else _in_words(status)}")

    def say(self, text: str) -> None:
        """Tell what happens."""
        self._output("midastouch", text)

    def _has_ended(self, child: _Child, status: int) -> None:
        process, child.process = child.process, None
        name, words = child.program.name, _in_words(status)
        if child.program.ends and status == 0:
            self.say(f"{name} has finished; Ctrl-C ends the others")
        elif child.program.ends or child.back_off is None or status == EXIT_BAD_INPUT:
            raise NodeFailed(f"{name} died: {words}", list(process.last_lines))
        else:
            self.say(f"{name} died: {words}; starting it again in {child.schedule(process.age):g} s")

    def _start_again(self, child: _Child) -> None:
        if child.due is None or time.monotonic() < child.due:
            return
        try:
            child.process, child.due = Process(child.program, self._environment, self._output), None
        except OSError as error:  # no memory for the moment, say: the others must not suffer for it
            name, delay = child.program.name, child.schedule(0.0)
            self.say(f"{name} could not be started: {error.strerror}; trying again in {delay:g} s")


class _Child:
    """One program: its process while it runs, or when it is due to be started again."""

    def __init__(self, program: Program, back_off: BackOff | None):
        self.program, self.back_off = program, back_off
        self.process: Process | None = None
        self.due: float | None = None

    def schedule(self, lived: float) -> float:
        """Let it be due after the back-off's pause, which is returned."""
        delay = self.back_off.after(lived)
        self.due = time.monotonic() + delay
        return delay


def _in_words(status: int) -> str:
    if status >= 0:
        return f"exit code {status}"
    return f"killed by {signal.Signals(-status).name}"
