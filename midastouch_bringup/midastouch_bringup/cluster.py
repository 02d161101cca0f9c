"""Work shared out to processes of this machine, or to a lab's cluster, by Dask.

A task is a function of its arguments alone, so that it does not matter where it runs or how often it is started: what a
dead worker had in hand goes to another, and each result is handed out once.
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
"""Dask has its workers give memory back to the system at each chance: arrays of images then took half of their time."""


class Cluster(Protocol):
    """Where tasks run."""

    def map(self, function: Callable[..., R], arguments: list[tuple], deadline: float = float("inf")) -> Iterator[R]:
        """Results of the function for each of the arguments, in any order; nothing is started after the deadline, in
        seconds of `time.monotonic`."""


@contextlib.contextmanager
def open_cluster(jobs: int = 1, address: str | None = None) -> Iterator[Cluster]:
    """This very process for one job, `jobs` processes of this machine, or the workers of the Dask scheduler at an
    address, such as tcp://10.0.0.1:8786.

    The local one listens on the loop-back device only and has no dashboard. Raises InputError if no scheduler answers.
    """
    if address is None and jobs == 1:
        yield _ThisProcess()
        return
    # imported here: it takes a second, and most commands share nothing out
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
                dashboard_address="127.0.0.1:0",  # of its health check: None would take the port 8787
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
                    # not pure: the same arguments are another task the next time
                    running.add(self._client.submit(function, *one, pure=False))

        hand_over(_AHEAD * max(len(self._client.nthreads()), 1))
        for future in running:
            try:
                result = future.result()
            except KilledWorker as error:
                raise InputError(f"workers died again and again ({error}); give each more memory") from error
            hand_over(1)
            yield result
