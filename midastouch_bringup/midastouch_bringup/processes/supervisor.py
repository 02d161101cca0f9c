"""Processes kept running in the foreground: started together, started again when they die, or ended together."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from .node_processes import bound_to_us, end

_STOP = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_LAST_OUTPUT_S = 1.0


@dataclass(frozen=True)
class Program:
    """What to run. `ends`: it ends by itself, once its work is done, and is never started again."""

    name: str
    command: tuple[str, ...]
    ends: bool = False


class BackOff:
    """How long to wait before a process is started again [s]: twice as long each time, up to `longest`.

    From the beginning again for one that has lived that long.
    """

    def __init__(self, first: float = 2.0, longest: float = 60.0):
        self._first, self._longest = first, longest
        self._next = first

    def after(self, lived: float) -> float:
        """The pause for a process that has died `lived` seconds after its start."""
        delay = self._first if lived >= self._longest else self._next
        self._next = min(2.0 * delay, self._longest)
        return delay


class Supervisor:
    """Runs programs until SIGINT, SIGTERM, SIGHUP or SIGQUIT arrives, all have ended, or one has died for good.

    Their output goes to ours, each line behind the name of its program. environment: of the programs.
    respawn: makes the back-off of one program; None: without one of them the others are of no use.
    """

    def __init__(
        self,
        programs: Sequence[Program],
        environment: Mapping[str, str],
        respawn: Callable[[], BackOff] | None = BackOff,
    ):
        self._environment = dict(environment)
        self._respawn = respawn is not None
        self._children = [_Child(program, respawn() if respawn else BackOff()) for program in programs]
        self._output = threading.Lock()
        self._failed = False

    def run(self) -> int:
        """Run them, in the main thread; returns 1 if one of them died for good, else 0.

        A second signal while they are being ended does not wait until those that are left have had their time.
        """
        # what the programs print may be more than our output's encoding holds; one put in its place may be no file
        if hasattr(sys.stdout, "reconfigure"):
            sys.stdout.reconfigure(errors="replace")
        with _woken_by_signals() as wait:
            try:
                for child in self._children:
                    self._start(child)
                while any(child.alive for child in self._children) and not self._failed:
                    due = min((child.due for child in self._children if child.due is not None), default=None)
                    if wait(None if due is None else due - time.monotonic()):
                        self._say("ending all")
                        break
                    for child in self._children:
                        self._look_after(child)
            finally:
                self._end(wait)
        return int(self._failed)

    def _start(self, child: _Child) -> None:
        child.start(self._environment, self._echo)

    def _start_again(self, child: _Child) -> None:
        try:
            self._start(child)
        except OSError as error:  # no memory for the moment, say: the others must not suffer for it
            name, delay = child.program.name, child.schedule()
            self._say(f"{name} could not be started: {error.strerror}; trying again in {delay:g} s")

    def _look_after(self, child: _Child) -> None:
        if child.due is not None:
            if time.monotonic() >= child.due:
                self._start_again(child)
            return
        if (status := child.take_status()) is None:
            return
        name = child.program.name
        if child.program.ends and status == 0:
            self._say(f"{name} has finished; Ctrl-C ends the others")
        elif child.program.ends or not self._respawn:
            self._failed = True
            self._say(f"{name} died: {_in_words(status)}; ending all")
        else:
            delay = child.schedule()
            self._say(f"{name} died: {_in_words(status)}; starting it again in {delay:g} s")

    def _end(self, wait: Callable[[float | None], bool]) -> None:
        running = {child.process: child for child in self._children if child.process is not None}

        def await_ends(left: list[subprocess.Popen], seconds: float) -> None:
            deadline = time.monotonic() + seconds
            while any(process.poll() is None for process in left) and time.monotonic() < deadline:
                if wait(deadline - time.monotonic()):
                    return

        end(running, await_ends)
        for child in running.values():
            status = child.take_status()
            if status not in (0, -signal.SIGINT):
                self._say(f"{child.program.name}: {'would not end' if status is None else _in_words(status)}")

    def _say(self, text: str) -> None:
        self._echo("midastouch", text)

    def _echo(self, name: str, line: str) -> None:
        # nobody may be reading any more; the programs go on
        with self._output, contextlib.suppress(OSError):
            print(f"[{name}] {line}", flush=True)


class _Child:
    """One program: its process while it runs, or when it is due to be started again."""

    def __init__(self, program: Program, back_off: BackOff):
        self.program = program
        self.process: subprocess.Popen | None = None
        self.due: float | None = None
        self._back_off = back_off
        self._born = 0.0
        self._reader: threading.Thread | None = None

    @property
    def alive(self) -> bool:
        return self.process is not None or self.due is not None

    def start(self, environment: Mapping[str, str], echo: Callable[[str, str], None]) -> None:
        self.due, self._born = None, time.monotonic()
        # a session of its own: Ctrl-C reaches this process alone, which then ends them in order
        self.process = subprocess.Popen(
            bound_to_us(self.program.command),
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, args=[self.process, echo], daemon=True)
        self._reader.start()

    def take_status(self) -> int | None:
        """How the process has ended, once; None while it runs."""
        status = None if self.process is None else self.process.poll()
        if status is not None:
            # its last words come before what is said about it; a process that it left behind may hold the pipe open
            self._reader.join(_LAST_OUTPUT_S)
            self.process = None
        return status

    def schedule(self) -> float:
        """Let it be due after the back-off's pause, which is returned."""
        now = time.monotonic()
        delay = self._back_off.after(now - self._born)
        self.due = now + delay
        return delay

    def _read(self, process: subprocess.Popen, echo: Callable[[str, str], None]) -> None:
        with process.stdout:
            for line in process.stdout:
                echo(self.program.name, line.decode(errors="replace").rstrip("\r\n"))


@contextlib.contextmanager
def _woken_by_signals() -> Iterator[Callable[[float | None], bool]]:
    """A function `wait(seconds)` that returns when a process ends, a signal to stop arrives, or the time is up.

    It returns whether a signal to stop has arrived since its last call. Such signals do nothing else meanwhile, so that
    none can hit between the start of a process and its being known.
    """
    reading, writing = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    # one that is ignored (nohup) stays so, but for SIGINT: shells without job control ignore it for what runs in the
    # background, and who sends it then means it
    numbers = [n for n in _STOP if n == signal.SIGINT or signal.getsignal(n) is not signal.SIG_IGN]
    # before the handlers: a signal in between would do nothing at all
    former = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    handlers = {number: signal.signal(number, lambda *_: None) for number in (*numbers, signal.SIGCHLD)}

    def wait(seconds: float | None) -> bool:
        if not select.select([reading], [], [], None if seconds is None else max(0.0, seconds))[0]:
            return False
        return any(number in _STOP for number in os.read(reading, 4096))

    try:
        yield wait
    finally:
        signal.set_wakeup_fd(former)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        os.close(reading)
        os.close(writing)


def _in_words(status: int) -> str:
    if status >= 0:
        return f"exit code {status}"
    return f"killed by {signal.Signals(-status).name}"
