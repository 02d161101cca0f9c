"""Programs kept running: started together, started again when they die, or ended together."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Mapping

from midastouch_common.errors import EXIT_BAD_INPUT

from .process import Output, Process, Program, end


class BackOff:
    """A pause [s] that is twice as long each time, up to `longest`.

    It starts over for a process that has lived for `longest`.
    """

    def __init__(self, first: float = 2.0, longest: float = 60.0):
        self._first, self._longest = first, longest
        self._next = first

    def after(self, lived: float) -> float:
        """Return the pause for a process that has died `lived` seconds after its start."""
        delay = self._first if lived >= self._longest else self._next
        self._next = min(2.0 * delay, self._longest)
        return delay


class NodeFailed(RuntimeError):
    """Raised if a node died before its time or fell silent. `cause`: one line; the message adds its last output."""

    def __init__(self, cause: str, last_lines: list[str] | None = None):
        self.cause = cause
        words = "" if last_lines is None else "\n".join(["; its last words:", *last_lines])
        super().__init__(cause + words.replace("\n", "\n  "))


class Supervisor:
    """Supervisor that starts programs as processes, watches them, and ends them; `with` ends all.

    environment: of the programs. output: gets their lines and, under the name `midastouch`, reports about them.
    """

    def __init__(self, environment: Mapping[str, str], output: Output):
        self._environment, self._output = environment, output
        self._children: dict[str, _Child] = {}

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def start(
        self, program: Program, back_off: BackOff | None = None, on_exit: Callable[[int, int], object] | None = None
    ) -> None:
        """Start a program. Raises OSError if it cannot be.

        back_off: it is started again when it dies, unless bad input has ended it. on_exit: called by `look_after` with
        its process id and exit status; without, a program that is not started again must not die.
        """
        child = _Child(program, back_off, on_exit)
        child.process = Process(program, self._environment, self._output)
        self._children[program.name] = child

    def look_after(self) -> float | None:
        """Start the programs again that are due; returns the seconds until the next one is due, None if there is none.

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
        """Process ids by name, of programs that run or whose end `look_after` has not handled yet."""
        return {name: child.process.pid for name, child in self._children.items() if child.process is not None}

    @property
    def busy(self) -> bool:
        """True while any program runs or is due to be started again."""
        return any(child.process is not None or child.due is not None for child in self._children.values())

    def end(self, await_ends: Callable[[list[Process], float], object] | None = None) -> None:
        """End all, as `process.end` does it."""
        running = {name: child.process for name, child in self._children.items() if child.process is not None}
        self._children.clear()
        end(running.values(), await_ends)
        for name, process in running.items():
            status = process.status()
            if status not in (0, -signal.SIGINT) and not (process.begins and status == -signal.SIGTERM):
                self.say(f"{name}: {'would not end' if status is None else _in_words(status)}")

    def say(self, text: str) -> None:
        """Report an event."""
        self._output("midastouch", text)

    def _has_ended(self, child: _Child, status: int) -> None:
        process, child.process = child.process, None
        name, words = child.program.name, _in_words(status)
        if child.on_exit is not None:
            if child.on_exit(process.pid, status):  # ends the others; raises if that is an error
                return
        elif (status and (child.program.ends or status == EXIT_BAD_INPUT)) or not (
            child.program.ends or child.back_off
        ):
            raise NodeFailed(f"{name} died: {words}", list(process.last_lines))
        if child.back_off is not None and not child.program.ends:
            self.say(f"{name} died: {words}; starting it again in {child.schedule(process.age):g} s")
        else:
            self.say(f"{name} has finished; Ctrl-C ends the others" if status == 0 else f"{name} died: {words}")

    def _start_again(self, child: _Child) -> None:
        if child.due is None or time.monotonic() < child.due:
            return
        try:
            child.process, child.due = Process(child.program, self._environment, self._output), None
        except OSError as error:  # such as no memory for the moment; the others keep running
            name, delay = child.program.name, child.schedule(0.0)
            self.say(f"{name} could not be started: {error.strerror}; trying again in {delay:g} s")


class _Child:
    """One program: its process while it runs, or the time at which it is due to be started again."""

    def __init__(self, program: Program, back_off: BackOff | None, on_exit: Callable[[int, int], object] | None):
        self.program, self.back_off, self.on_exit = program, back_off, on_exit
        self.process: Process | None = None
        self.due: float | None = None

    def schedule(self, lived: float) -> float:
        """Make it due after the back-off's pause; return the pause."""
        delay = self.back_off.after(lived)
        self.due = time.monotonic() + delay
        return delay


def _in_words(status: int) -> str:
    if status >= 0:
        return f"exit code {status}"
    return f"killed by {signal.Signals(-status).name}"
