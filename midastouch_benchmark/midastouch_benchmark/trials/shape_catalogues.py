"""How catalogues of ever more objects fare: slides over random shapes, each among so many others."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np

from midastouch_bringup.processes.process import resident_mb
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.identification.catalogue import ROOM, Catalogue, read_catalogue
from midastouch_filter.identification.identification import Identification
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import build_codebook
from midastouch_perception.simulation.procedural import random_shape

from ..statistics.intervals import ENOUGH
from .cache import Cache
from .identification import Answers, IdentityPlan
from .trial import TrialFrame
from .trial_log import TrialLog, Workforce, key_of, run_open, source_digest

EARLY = 0.1
"""m of path after which is asked, besides the end."""

_SEED = 0


@dataclasses.dataclass(frozen=True)
class ShapePlan(IdentityPlan):
    """room, for so many poses that a touch is compared with; sizes of the catalogues; touched, how many shapes are slid
    over."""

    room: int = ROOM
    sizes: tuple[int, ...] = (10, 100)
    touched: int = ENOUGH

    def describe(self) -> dict:
        """For the JSON."""
        return (
            super().describe()
            | {"room": self.room, "sizes": self.sizes, "touched": self.touched, "seed": _SEED}
            | {"shape_code": source_digest(Path(__file__))}
        )

    def mates(self, number: int, size: int) -> range:
        """Numbers of the shapes in the catalogue of that size which holds shape `number`."""
        first = number // size * size
        return range(first, first + size)


def run_shapes(plan: ShapePlan, log: TrialLog, workforce: Workforce) -> tuple[list[dict], int]:
    """Run what the log does not hold yet, as `run_open`: each slide with its shape in the catalogue and without."""
    numbers = {number for size in plan.sizes for number in plan.mates(plan.touched - 1, size)} | set(
        range(plan.touched)
    )
    books = dict(workforce.cluster.map(_make, [(plan.cache, number) for number in sorted(numbers)]))
    described = plan.describe() | {"sizes": None, "touched": None, "slides": plan.cache.slides.name}
    units = [
        (
            (plan, tuple(books[each] for each in plan.mates(number, size))),
            {key_of(described | {"size": size, "shape": number, "slide": slide}): (size, number, slide)},
        )
        for size in plan.sizes
        for slide in plan.slides
        for number in range(plan.touched)
    ]
    done, missing = run_open(_run_slides, units, log, workforce)
    return [trial for both in done for trial in both["trials"]], missing


def shape_path(cache: Cache, number: int) -> Path:
    """Where the mesh of a random shape is kept."""
    return cache.folder / "shapes" / f"shape_{number:04d}.ply"


def _make(cache: Cache, number: int) -> tuple[int, Path]:
    """Make a shape and its codebook, unless they are there: its number and the path of the latter.

    No filter runs on it, so that nothing is derived.
    """
    path, networks = shape_path(cache, number), cache.networks
    if not path.is_file():
        random_shape(np.random.default_rng([_SEED, number]), path.stem).save(path)
    mesh = ObjectMesh.load(path)
    book = cache.codebook_path(mesh)
    try:
        Codebook.load(book, mesh=mesh, tcn=networks.tcn.network_id, first=1)
    except InputError:  # none yet, or of an older mesh or network
        build_codebook(mesh, networks.tcn, networks.sensor, cache.codebook_size).save(book)
    return number, book


def _run_slides(plan: ShapePlan, books: tuple[Path, ...], slides: dict[str, tuple[int, int, int]]) -> dict[str, dict]:
    """Both trials of each slide, given by the size of its catalogue, shape and number; by key."""
    return {key: {"trials": _run_slide(plan, books, *which)} for key, which in slides.items()}


def _run_slide(plan: ShapePlan, books: tuple[Path, ...], size: int, number: int, slide: int) -> list[dict]:
    catalogue = _catalogue(books, plan.settings, plan.room)
    mesh = ObjectMesh.load(shape_path(plan.cache, number))
    frames = plan.cache.frames(mesh, slide)
    labels = {"object": mesh.name, "slide": slide, "size": size}
    trials = [labels | {"in_catalogue": True} | _identify(catalogue, frames, mesh.name, plan)]
    if size > 1:
        trials.append(labels | {"in_catalogue": False} | _identify(catalogue.without(mesh.name), frames, UNKNOWN, plan))
    return trials


@lru_cache(maxsize=1)
def _catalogue(books: tuple[Path, ...], config: FilterConfig, room: int) -> Catalogue:
    return read_catalogue(books, lambda path: None, NoiseModel.of(config), room)


def _identify(catalogue: Catalogue, frames: Iterable[TrialFrame], truth: str, plan: ShapePlan) -> dict:
    """A slide over a shape, truth, or `UNKNOWN` if it is not in the catalogue: what `Answers.describe` says, and

    early, after `EARLY` m, and late, at the end: compared, whether it was among the objects that were, and leads,
    whether none of them was more probable; cpu_ms, mean of a frame, slowest_ms and memory_mib of the process.
    """
    identification = Identification(catalogue, plan.settings, NoiseModel.of(plan.settings))
    answers, last, took, early = Answers(truth), None, [], None
    for frame in frames:
        start = time.process_time()
        identification.step(None if last is None else se3.inverse(last) @ frame.measured, frame.measurement)
        took.append(1e3 * (time.process_time() - start))
        last = frame.measured
        identity = identification.identity
        answers.note(frame, identity)
        late = {"compared": truth in identification.compared.names, "leads": identity.leading.name == truth}
        early = late if early is None and answers.path >= EARLY else early
    return answers.describe() | {
        "early": early or late,
        "late": late,
        "cpu_ms": float(np.mean(took)),
        "slowest_ms": max(took),
        "memory_mib": resident_mb(os.getpid()),
    }
