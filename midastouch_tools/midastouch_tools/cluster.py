"""Work distributed by Dask over processes of this machine or over a lab's cluster.

A task depends on its arguments alone, so it does not matter where it runs or how many times it is started: the tasks of
a dead worker go to another one, and each result is returned once.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Protocol, TypeVar

from midastouch_common.errors import InputError

R = TypeVar("R")
_AHEAD = 2  # tasks per worker that are handed over before they are needed
CONNECT_S = 10.0
_TRIM = "MALLOC_TRIM_THRESHOLD_"
"""Dask sets this in its workers, so that they return memory at once; with image arrays that took half of their time."""


class Cluster(Protocol):
    """Executor of tasks."""

    def map(self, function: Callable[..., R], arguments: list[tuple], deadline: float = float("inf")) -> Iterator[R]:
        """Yield the results of the function for all arguments, in any order; no task is started after the deadline, in
        seconds of `time.monotonic`."""


@contextlib.contextmanager
def open_cluster(jobs: int = 1, address: str | None = None) -> Iterator[Cluster]:
    """Open a cluster: this process for one job, `jobs` processes of this machine, or the workers of the Dask scheduler
    at an address such as tcp://10.0.0.1:8786.

    Local workers listen on the loop-back device only and have no dashboard. Raises InputError if no scheduler answers.
    """
    if address is None and jobs == 1:
        yield _ThisProcess()
        return
    # imported here: it takes a second, and most commands distribute nothing
    from distributed import Client, LocalCluster
    from distributed.config import config

    with contextlib.ExitStack() as stack:
        if address is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="midastouch"))
            config["distributed"]["nanny"]["pre-spawn-environ"].pop(_TRIM, None)
            local = LocalCluster(
                n_workers=jobs,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # of its health check; None would take port 8787
                scheduler_kwargs={"dashboard": False},
                memory_limit=0,
                local_directory=folder,
                silence_logs="CRITICAL",
            )
            client = stack.enter_context(Client(stack.enter_context(local)))
        else:
            try:
                client = stack.enter_context(Client(address, timeout=CONNECT_S))
            except (OSError, ValueError) as error:
                raise InputError(f"{address}: no scheduler answers ({error}); start one: dask scheduler") from error
        yield _Dask(client)


class _ThisProcess:
    def map(self, function: Callable[..., R], arguments: list[tuple], deadline: float = float("inf")) -> Iterator[R]:
        for one in arguments:
            if time.monotonic() >= deadline:
                return
            yield function(*one)


class _Dask:
    def __init__(self, client) -> None:
        self._client = client

    def map(self, function: Callable[..., R], arguments: list[tuple], deadline: float = float("inf")) -> Iterator[R]:
        from distributed import KilledWorker, as_completed

        left = iter(arguments)
        running = as_completed()

        def hand_over(n: int) -> None:
            if time.monotonic() < deadline:
                for one in islice(left, n):
                    # not pure: Dask would reuse the result of an earlier task with the same arguments
                    running.add(self._client.submit(function, *one, pure=False))

        hand_over(_AHEAD * max(len(self._client.nthreads()), 1))
        for future in running:
            try:
                result = future.result()
            except KilledWorker as error:
                raise InputError(f"workers died again and again ({error}); give each more memory") from error
            hand_over(1)
            yield result
