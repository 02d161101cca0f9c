"""Tasks, which depend on their arguments alone, shared by processes of this machine or those of another executor."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice, starmap, takewhile
from multiprocessing.connection import Connection
from typing import TypeVar

from midastouch_common.errors import InputError
from midastouch_common.stop_signals import sparing_children

R = TypeVar("R")
_AHEAD = 2  # tasks per worker that are handed over before they are needed
_ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


class Workers:
    """Workers that share tasks: this process, or those of an executor; count: returns how many there are."""

    def __init__(self, executor: Executor | None = None, count: Callable[[], int] = lambda: 1) -> None:
        self._executor, self._count = executor, count

    def map(self, function: Callable[..., R], arguments: list[tuple], deadline: float = float("inf")) -> Iterator[R]:
        """Yield the results of the function for all arguments, in any order; no task is started after the deadline, in
        seconds of `time.monotonic`."""
        left = takewhile(lambda _: time.monotonic() < deadline, arguments)
        if self._executor is None:
            yield from starmap(function, left)
            return
        running = {self._executor.submit(function, *one) for one in islice(left, _AHEAD * max(self._count(), 1))}
        while running:
            done = wait(running, return_when=FIRST_COMPLETED).done
            running -= done
            # failures last: the death of one worker fails the tasks of all, but not what had been done
            for future in sorted(done, key=lambda each: each.exception() is not None):
                yield future.result()
                running.update(self._executor.submit(function, *one) for one in islice(left, 1))


@contextlib.contextmanager
def open_workers(jobs: int) -> Iterator[Workers]:
    """Open the workers of this machine: this process for one job, otherwise `jobs` processes.

    Processes import what they run by its name, so functions are those of modules. They end with the context, at once if
    an exception leaves it. Raises InputError if one of them dies.
    """
    if jobs == 1:
        yield Workers()
        return
    context = multiprocessing.get_context("spawn")  # a fork copies the locks of threads, not the threads
    theirs, ours = context.Pipe(duplex=False)
    executor = _Processes(jobs, mp_context=context, initializer=_begin, initargs=(theirs,))
    with theirs, ours:
        try:
            yield Workers(executor, lambda: jobs)
            executor.shutdown()
        except BrokenProcessPool as error:
            raise InputError("a worker process died; run it again, with fewer --jobs if memory is short") from error
        finally:
            ours.close()
            executor.shutdown(cancel_futures=True)


class _Processes(ProcessPoolExecutor):
    """Processes whose libraries use one thread, unless the environment says otherwise; they read it when imported."""

    def submit(self, *task):
        absent = [name for name in _ONE_THREAD if name not in os.environ]
        os.environ.update(dict.fromkeys(absent, "1"))
        try:
            with sparing_children():
                return super().submit(*task)  # starts a process if none is idle
        finally:
            for name in absent:
                del os.environ[name]


def _begin(parent: Connection) -> None:
    """Begin a worker: it ends when the parent closes its side or dies."""

    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
