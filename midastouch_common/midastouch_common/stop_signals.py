"""Stop signals as events: the current work is finished before the process ends, except for `interruptible` work.

Python's own handler raises KeyboardInterrupt between any two instructions; rclpy's shuts the context down while nodes
are using it. Both leave nodes half made or half destroyed and threads running; a thread that is inside C++ (OpenCV,
say) when Python ends aborts the process: "terminate called without an active exception".
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence

_NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopped(BaseException):
    """A signal to stop has cut `interruptible` work short. Not an Exception, so no code handles it as a failure."""


class _Arrivals:
    """State that the handler of a `stop_event` has in common with the work that it may cut short."""

    def __init__(self) -> None:
        self.any = self.cut_short = False

    def handle(self, *_: object) -> None:
        """Handler of a signal."""
        self.any = True
        if self.cut_short:
            self.cut_short = False  # only once: a second signal must not break off the clean-up
            raise Stopped


_arrivals = _Arrivals()  # one for the process, because signals belong to the process


def end_at_once() -> None:
    """Make a signal to stop end the process at once with exit code 0, while there is nothing to clean up yet."""
    for number in _handled():
        signal.signal(number, lambda *_: os._exit(0))


@contextlib.contextmanager
def stop_event(wake: Callable[[], object]) -> Iterator[threading.Event]:
    """Yield an event that every signal to stop sets. Use it in the main thread.

    Each signal also calls ``wake``, in another thread. Once the context is left, signals to stop are ignored, because
    the process is ending.
    """
    global _arrivals
    stopping, _arrivals = threading.Event(), _Arrivals()
    numbers = _handled()
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def watch() -> None:
        while arrived := os.read(reading, 64):  # empty once the pipe is closed
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
    """Let a signal to stop end the work inside between any two instructions of Python, by raising `Stopped`.

    Use it for work that only computes and reads, inside a `stop_event` and in its thread; elsewhere it has no effect.
    A signal that came earlier ends the work at once. After a signal any Exception becomes `Stopped`, because a library
    in C that is being imported turns `Stopped` into an ImportError.
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
    """Return the signals to handle: all but those that are ignored already (SIGHUP under nohup).

    SIGINT is always handled: shells without job control ignore it for background processes, but a SIGINT that is sent
    to one is meant for it.
    """
    return [n for n in _NUMBERS if n == signal.SIGINT or signal.getsignal(n) is not signal.SIG_IGN]


@contextlib.contextmanager
def sparing_children() -> Iterator[None]:
    """Spare processes that are started inside SIGINT: Ctrl-C reaches them, too, and even while they still import they
    would end in a traceback. They inherit that it is blocked; here it arrives afterwards."""
    from multiprocessing.resource_tracker import ensure_running  # here, for the reason of `bound_to_us`

    ensure_running()  # which unblocks SIGINT when it starts
    former = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


def bound_to_us(command: Sequence[str | os.PathLike]) -> list[str | os.PathLike]:
    """Return a command whose process gets SIGTERM when the thread that started it, and so this process, is gone.

    This holds even after SIGKILL, which leaves a parent no time to end its children: they would keep running unseen,
    and keep sensor and topics. Without `setpriv` (util-linux, part of every Debian and Ubuntu), it returns the command
    unchanged.
    """
    import shutil  # here: it imports much, while a program that starts handles no signals yet

    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "TERM", "--", *command] if setpriv else [*command]
