"""Campaigns of trials by several workers, and finished trials on disk: a long run continues where it was stopped."""

from __future__ import annotations

import hashlib
import json
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from midastouch_common.mesh import ObjectMesh
from midastouch_tools.jobs import Workers
from midastouch_tools.progress import progress_bar
from midastouch_tools.result_file import to_json

from .cache import Cache


class TrialLog:
    """Log of trials by key, a line each, to which trials are only appended. A line cut off by a crash is skipped."""

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
            # on a line of its own, even after one that was cut off
            stream.write("\n" + json.dumps({"key": key, "trial": trial}, allow_nan=False))
        self._trials[key] = trial


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


def make_books(cache: Cache, meshes: Iterable[Path], workers: Workers, sizes: tuple[int | None, ...] = (None,)) -> None:
    """Make the missing codebooks of these sizes, even after the deadline: keys of trials depend on them."""
    for _ in workers.map(_make_book, [(cache, path, sizes) for path in meshes]):
        pass


def _make_book(cache: Cache, path: Path, sizes: tuple[int | None, ...]) -> None:
    mesh = ObjectMesh.load(path)
    for size in sizes:
        cache.codebook(mesh, size)


def run_open(
    run: Callable[..., Mapping[str, dict]],
    units: Iterable[tuple[tuple, Mapping[str, Any]]],
    log: TrialLog,
    workers: Workers,
    deadline: float = math.inf,
    name: str = "trial",
) -> tuple[list[dict], int]:
    """Run the trials that the log lacks; return all finished trials, in order, and the number of unfinished ones.

    units: work of one worker at a time: arguments, and a request for each trial by its key. run(*arguments, open
    requests by key) returns the trials by key. deadline: in seconds of `time.monotonic`, after which nothing new is
    started; name: of one trial, for the progress bar.
    """
    units = list(units)
    open_ = []
    for arguments, asked in units:
        lacking = {key: what for key, what in asked.items() if log.get(key) is None}
        open_ += [(*arguments, lacking)] if lacking else []
    with progress_bar(total=sum(len(lacking) for *_, lacking in open_), unit=name) as bar:
        for trials in workers.map(run, open_, deadline):
            for key, trial in trials.items():
                log.add(key, trial)
                bar.update(1)
    keys = [key for _, asked in units for key in asked]
    done = [trial for key in keys if (trial := log.get(key)) is not None]
    return done, len(keys) - len(done)


class Campaign(ABC):
    """Trials over objects, each of which depends on the object and on its own labels. A plan: its fields are settings.

    Attributes: cache: of what the trials need; LOG_NAME: file that keeps finished trials; UNIT: name of one trial.
    """

    cache: Cache
    LOG_NAME: ClassVar[str]
    UNIT: ClassVar[str] = "trial"

    @property
    def folder(self) -> Path:
        """Folder of the finished trials."""
        return self.cache.folder

    def prepare(self, meshes: Sequence[ObjectMesh], workers: Workers) -> None:
        """Make all that the keys of trials depend on: the codebooks."""
        make_books(self.cache, [mesh.path for mesh in meshes], workers)

    @abstractmethod
    def describe(self) -> dict:
        """Return the settings for the JSON."""

    @abstractmethod
    def rounds(self) -> Iterable[Sequence[dict]]:
        """Return the labels of the trials on each object; a run that is bounded leaves out the last rounds."""

    @abstractmethod
    def depends_on(self, mesh: ObjectMesh) -> dict:
        """Return everything on which a trial depends, except its labels."""

    @abstractmethod
    def trial(self, mesh: ObjectMesh, labels: dict) -> dict:
        """Run one trial, in any process, and return its result."""

    def run(self, meshes: Sequence[ObjectMesh], workers: Workers, deadline: float = math.inf) -> tuple[list[dict], int]:
        """Run the trials that the log does not hold yet, as `run_open`."""
        self.prepare(meshes, workers)
        units = []
        for labels_of_round in self.rounds():
            for mesh in meshes:
                shared = self.depends_on(mesh) | {"mesh": mesh.sha256}
                for labels in ({"object": mesh.name} | each for each in labels_of_round):
                    units.append(((self, mesh.path), {key_of(labels | shared): labels}))
        log = TrialLog(self.folder / self.LOG_NAME)
        return run_open(_run_trials, units, log, workers, deadline, self.UNIT)


def _run_trials(plan: Campaign, path: Path, trials: dict[str, dict]) -> dict[str, dict]:
    """Run trials on one object, given as labels by key, and return the labels with the results."""
    mesh = ObjectMesh.load(path)
    return {key: labels | plan.trial(mesh, labels) for key, labels in trials.items()}
