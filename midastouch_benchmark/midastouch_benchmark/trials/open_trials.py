"""What the log of a campaign does not hold yet, run on a cluster and kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_bringup.cluster import Cluster
from midastouch_common.mesh import ObjectMesh

from .stock import Stock
from .trial_log import TrialLog


def untold(total: int) -> Callable[[int], object]:
    """Progress that nobody watches, as `Workforce` takes it."""
    return lambda done: None


@dataclass(frozen=True)
class Workforce:
    """Who runs trials, and until when.

    Attributes: cluster; deadline, in seconds of `time.monotonic`, after which nothing new is started; start_progress is
    called with the number of trials to run, what it returns with the number done since.
    """

    cluster: Cluster
    deadline: float = np.inf
    start_progress: Callable[[int], Callable[[int], object]] = untold


def make_books(stock: Stock, meshes: Iterable[Path], cluster: Cluster, sizes: tuple[int | None, ...] = (None,)) -> None:
    """Codebooks of these sizes, as far as they are not there, whatever the time: keys of trials depend on them."""
    for _ in cluster.map(_make_book, [(stock, path, sizes) for path in meshes]):
        pass


def _make_book(stock: Stock, path: Path, sizes: tuple[int | None, ...]) -> None:
    mesh = ObjectMesh.load(path)
    for size in sizes:
        stock.codebook(mesh, size)


def run_open(
    run: Callable[..., Mapping[str, dict]],
    units: Iterable[tuple[tuple, Mapping[str, Any]]],
    log: TrialLog,
    workforce: Workforce,
) -> tuple[list[dict], int]:
    """Run the trials that the log lacks; all that are done then, in order, and how many are not.

    units: what one worker does at a time: arguments, and what is asked for by the key of each trial. run(*arguments,
    what is still asked for) returns the trials by key.
    """
    units = list(units)
    open_ = []
    for arguments, asked in units:
        lacking = {key: what for key, what in asked.items() if log.get(key) is None}
        open_ += [(*arguments, lacking)] if lacking else []
    progress = workforce.start_progress(sum(len(lacking) for *_, lacking in open_))
    for trials in workforce.cluster.map(run, open_, workforce.deadline):
        for key, trial in trials.items():
            log.add(key, trial)
            progress(1)
    keys = [key for _, asked in units for key in asked]
    done = [trial for key in keys if (trial := log.get(key)) is not None]
    return done, len(keys) - len(done)
