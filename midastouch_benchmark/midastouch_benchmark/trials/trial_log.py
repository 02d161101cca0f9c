"""Finished trials on disk, one JSON line each, so that a long run continues where it was stopped."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_tools.cluster import Cluster
from midastouch_tools.result_file import to_json

from .cache import Cache


class TrialLog:
    """Log of trials by key, to which trials are only appended. A line cut off by a crash is skipped."""

    def __init__(self, path: str | os.PathLike):
        self._path = Path(path)
        self._trials: dict[str, dict] = {}
        if self._path.is_file():
            for line in self._path.read_text().splitlines():
                try:
                    entry = json.loads(line)
                    self._trials[entry["key"]] = entry["trial"]
                except (ValueError, KeyError, TypeError):
                    continue

    def get(self, key: str) -> dict | None:
        """Return the trial; None if it was not run yet."""
        return self._trials.get(key)

    def add(self, key: str, trial: dict) -> None:
        """Keep a trial."""
        trial = to_json(trial)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a") as stream:
            # on its own line even after one that was cut off
            lead = "" if stream.tell() == 0 or self._ends_with_newline() else "\n"
            stream.write(lead + json.dumps({"key": key, "trial": trial}, allow_nan=False) + "\n")
        self._trials[key] = trial

    def _ends_with_newline(self) -> bool:
        with self._path.open("rb") as stream:
            stream.seek(-1, os.SEEK_END)
            return stream.read(1) == b"\n"


def key_of(content: dict) -> str:
    """Return a key for everything that a trial depends on."""
    return hashlib.sha256(json.dumps(to_json(content), sort_keys=True).encode()).hexdigest()[:24]


def source_digest(*places: Path) -> str:
    """Return a hash of files, and of the Python files and compiled modules in folders and below, so that results of
    older code are not taken for those of newer code."""
    digest = hashlib.sha256()
    inside = [path for place in places for pattern in ("*.py", "*.so") for path in place.rglob(pattern)]
    for path in sorted([*inside, *(place for place in places if place.is_file())]):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


@dataclass(frozen=True)
class Workforce:
    """Cluster that runs trials, and its deadline.

    Attributes: cluster; deadline: in seconds of `time.monotonic`, after which nothing new is started; start_progress:
    called with the number of trials to run; the function that it returns is called with the number done since.
    """

    cluster: Cluster
    deadline: float = np.inf
    start_progress: Callable[[int], Callable[[int], object]] = lambda total: lambda done: None


def make_books(cache: Cache, meshes: Iterable[Path], cluster: Cluster, sizes: tuple[int | None, ...] = (None,)) -> None:
    """Make the missing codebooks of these sizes, even after the deadline: keys of trials depend on them."""
    for _ in cluster.map(_make_book, [(cache, path, sizes) for path in meshes]):
        pass


def _make_book(cache: Cache, path: Path, sizes: tuple[int | None, ...]) -> None:
    mesh = ObjectMesh.load(path)
    for size in sizes:
        cache.codebook(mesh, size)


def run_open(
    run: Callable[..., Mapping[str, dict]],
    units: Iterable[tuple[tuple, Mapping[str, Any]]],
    log: TrialLog,
    workforce: Workforce,
) -> tuple[list[dict], int]:
    """Run the trials that the log lacks; return all finished trials, in order, and the number of unfinished ones.

    units: work of one worker at a time: arguments, and a request for each trial by its key. run(*arguments, open
    requests by key) returns the trials by key.
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
