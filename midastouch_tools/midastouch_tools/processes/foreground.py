"""Signals to stop, and the output of programs, in the foreground of a terminal."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from types import FrameType

from .process import Process

_AGAIN_S = 0.05
_STOP = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
Wait = Callable[[float | None], bool]


@contextlib.contextmanager
def interrupted_by_signals() -> Iterator[None]:
    """Turn each signal to stop into KeyboardInterrupt, as Ctrl-C is, so that half-written files are removed.

    The signal's number is its argument, for `exit_status`. Outside of the main thread nothing is changed. What has set
    other handlers meanwhile, as nodes do, keeps them. A signal waits for the end of an import: libraries such as
    trimesh take whatever is raised meanwhile for a module that is missing, and go on. Python itself drops what is
    raised in a `__del__`.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:
        _leave_a_closed_terminal(number)
        if not _is_lost_in(frame):
            raise KeyboardInterrupt(number)
        again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), number))
        again.daemon = True
        again.start()

    here = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.signal(number, interrupt) for number in (_heard() if here else ())}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            if signal.getsignal(number) is interrupt:
                signal.signal(number, handler)


def _leave_a_closed_terminal(number: int, _: FrameType | None = None) -> None:
    """After SIGHUP, write to nowhere in place of the terminal, which is gone: words would end what is still to do."""
    if number != signal.SIGHUP:
        return
    nowhere = os.open(os.devnull, os.O_RDWR)
    for file in range(3):
        with contextlib.suppress(OSError):  # one that was closed before
            if stat.S_ISCHR(os.fstat(file).st_mode) and not os.isatty(file):
                os.dup2(nowhere, file)
    os.close(nowhere)


def _is_lost_in(frame: FrameType | None) -> bool:
    """Return whether what is raised in a frame is lost: a module is being imported, or an object deleted."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib") or frame.f_code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


@contextlib.contextmanager
def handlers_kept() -> Iterator[None]:
    """Set the handlers of signals to stop back in the end: nodes leave them ignored, as if their process ended."""
    handlers = {number: signal.getsignal(number) for number in _STOP}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def exit_status(interrupt: KeyboardInterrupt) -> int:
    """Return the exit status that shells expect after a signal: 130 after Ctrl-C, 143 after SIGTERM."""
    return 128 + (interrupt.args[0] if interrupt.args else signal.SIGINT)


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """End a script by a signal to stop without a traceback, once its context managers have cleaned up."""
    try:
        with interrupted_by_signals():
            yield
    except KeyboardInterrupt as interrupt:
        sys.exit(exit_status(interrupt))


@contextlib.contextmanager
def woken_by_signals() -> Iterator[Wait]:
    """Provide a function `wait(seconds)` that returns when a process ends, a signal to stop arrives, or time is up.

    It returns whether a signal to stop has arrived since its last call. Such signals do nothing else meanwhile, so that
    none can strike between the start of a process and its registration.
    """
    reading, writing = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    # before the handlers: a signal in between would do nothing at all
    former = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    handlers = {number: signal.signal(number, _leave_a_closed_terminal) for number in (*_heard(), signal.SIGCHLD)}

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


def _heard() -> list[signal.Signals]:
    """Return SIGINT and those signals to stop that are not ignored, as by nohup. SIGINT counts even if ignored: shells
    without job control ignore it for background processes, so a SIGINT that is sent there is meant."""
    return [n for n in _STOP if n == signal.SIGINT or signal.getsignal(n) is not signal.SIG_IGN]


def await_ends(wait: Wait, left: Sequence[Process], seconds: float) -> bool:
    """Wait until the processes have ended, a signal to stop arrives, or time is up; return whether one arrived."""
    deadline = time.monotonic() + seconds
    while any(process.runs for process in left) and time.monotonic() < deadline:
        if wait(deadline - time.monotonic()):
            return True
    return False


def echo() -> Callable[[str, str], None]:
    """Return a function that prints lines from several threads."""
    # the programs may print characters outside of our output's encoding; a replaced stdout may not be a file
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")
    one_at_a_time = threading.Lock()

    def print_line(name: str, line: str) -> None:
        # the reader may be gone; the programs continue
        with one_at_a_time, contextlib.suppress(OSError):
            print(f"[{name}] {line}", flush=True)

    return print_line
