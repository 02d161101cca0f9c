"""Signals that ask a process to end, taken as an event: whatever runs is finished first, but for `interruptible` work.

Python's own handler raises KeyboardInterrupt between any two instructions, rclpy's shuts the context down under
whatever the nodes do at that moment. Both leave nodes half made or half destroyed and threads running; a thread that
is inside C++ (OpenCV, say) when Python ends aborts the process: "terminate called without an active exception".
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopped(BaseException):
    """A signal to stop has cut `interruptible` work short. No Exception: nobody is to take it for a failure."""


class _Arrivals:
    """What the handler of a `stop_event` and the work that it may cut short know of each other."""

    def __init__(self) -> None:
        self.any = self.cut_short = False

    def handle(self, *_: object) -> None:
        """Handler of a signal."""
        self.any = True
        if self.cut_short:
            self.cut_short = False  # once: what cleans up after the work is finished
            raise Stopped


_arrivals = _Arrivals()  # of the process, as its signals are


def end_at_once() -> None:
    """From now on a signal to stop ends the process with exit code 0: there is nothing to clean up yet."""
    for number in _handled():
        signal.signal(number, lambda *_: os._exit(0))


@contextlib.contextmanager
def stop_event(wake: Callable[[], None]) -> Iterator[threading.Event]:
    """An event that every signal to stop sets. Use it in the main thread.

    ``wake`` is called in another thread each time, until the context is left. After that, signals to stop are ignored,
    because the process is ending.
    """
    global _arrivals
    stopping, _arrivals = threading.Event(), _Arrivals()
    numbers = _handled()
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def watch() -> None:
        while arrived := os.read(reading, 64):  # nothing: closed
            if any(number in numbers for number in arrived):
                stopping.set()
                wake()

    watcher = threading.Thread(target=watch, name="stop_signals")
    watcher.start()
    # before the handlers: a signal in between would do nothing at all
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for number in numbers:
        signal.signal(number, _arrivals.handle)
    try:
        yield stopping
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)
        os.close(writing)
        watcher.join()
        os.close(reading)
        _arrivals = _Arrivals()


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Work that a signal to stop ends between any two instructions of Python, by `Stopped`.

    For work that only computes and reads, inside a `stop_event` and in its thread; elsewhere it changes nothing. A
    signal that has come before ends it at once. What the work raises after a signal is taken for `Stopped`: a library
    written in C that is being imported makes an ImportError of it.
    """
    arrivals = _arrivals
    try:
        arrivals.cut_short = True
        if arrivals.any:
            raise Stopped
        yield
    except Exception:
        if arrivals.any:
            raise Stopped from None
        raise
    finally:
        arrivals.cut_short = False


def _handled() -> list[signal.Signals]:
    """The signals to handle. One that is ignored (SIGHUP under nohup) stays ignored.

    SIGINT is the exception: shells without job control ignore it for background processes, but whoever sends it to one
    means it.
    """
    return [n for n in _NUMBERS if n == signal.SIGINT or signal.getsignal(n) is not signal.SIG_IGN]
