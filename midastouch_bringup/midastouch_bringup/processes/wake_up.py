"""Waiting that ends when a process does, or when a signal to stop arrives."""

from __future__ import annotations

import contextlib
import os
import select
import signal
from collections.abc import Callable, Iterator

_STOP = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


@contextlib.contextmanager
def woken_by_signals() -> Iterator[Callable[[float | None], bool]]:
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
