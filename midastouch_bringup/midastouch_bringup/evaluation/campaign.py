"""Accuracy: objects x variants x slides x starts x seeds, resumable, in several processes."""

from __future__ import annotations

import dataclasses
import multiprocessing
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

import midastouch_filter
import midastouch_kernels
from midastouch_filter.config import FilterConfig
from midastouch_perception.mesh import ObjectMesh

from . import paper_filter
from .calibration import likelihood_counts
from .disturbances import DISTURBANCES, PLAIN
from .sequence_trials import TrialPlan
from .short_codes import ShortCodes
from .stock import Stock
from .trial import RECORD, TrialFrame, run_trial
from .trial_log import TrialLog, key_of, source_digest
from .variants import VARIANTS


@dataclasses.dataclass(frozen=True)
class Plan:
    """What is run: stock; config, the default's filter settings; variants by name; inits, "paper" or "uniform"; beta,
    of the former; slides and seeds, their numbers; stride, every n-th frame; protocol, one of `DISTURBANCES` or
    the name of what the stock's slides are; threads of the filter (0: one per core)."""

    stock: Stock
    config: FilterConfig
    variants: tuple[str, ...]
    inits: tuple[str, ...] = ("paper", "uniform")
    beta: float = 1.0
    slides: tuple[int, ...] = (0, 1, 2, 3, 4)
    seeds: tuple[int, ...] = tuple(range(10))
    stride: int = 1
    protocol: str = PLAIN
    threads: int = 0

    def describe(self) -> dict:
        """For the JSON; `midastouch report` shows it."""
        return {
            "inits": self.inits,
            "beta": self.beta,
            "slides": self.slides,
            "seeds": self.seeds,
            "stride": self.stride,
            "protocol": self.protocol,
            "slide_length_m": self.stock.length,
            "codebook_size": self.stock.codebook_size,
            "networks": self.stock.describe(),
            "filter": dataclasses.asdict(self.config),
            "filter_code": _filter_code(),
            "threads": self.threads,
        }

    def labels(self, mesh: ObjectMesh, variant: str, slide: int, init: str, seed: int) -> dict:
        """Those of one trial."""
        return {
            "sequence": f"{mesh.name}/{slide:02d}",
            "object": mesh.name,
            "slide": slide,
            "seed": seed,
            "init": init,
            "variant": variant,
            "protocol": self.protocol,
        }

    def key(self, mesh: ObjectMesh, codebook_digest: str, labels: dict) -> str:
        """Name of everything that the trial with these labels depends on."""
        variant = VARIANTS[labels["variant"]]
        depends_on = {
            "mesh": mesh.sha256,
            "settings": dataclasses.asdict(variant.config(self.config, 0)),
            "beta": self.beta,
            "stride": self.stride,
            "length": self.stock.length,
            "codebook": codebook_digest,
            "networks": self.stock.describe(),
            "filter_code": _filter_code(),
            "record": RECORD,
        }
        return key_of(labels | depends_on | variant.inputs)

    def codebook_sizes(self) -> list[int | None]:
        """Of all variants; None is the stock's own."""
        return list(dict.fromkeys(VARIANTS[name].codebook_size for name in self.variants))


@dataclasses.dataclass(frozen=True)
class _Unit:
    """One filter's work: trials of one variant on one object, by their labels and keys."""

    mesh: Path
    variant: str
    trials: list[tuple[str, dict]]


def run_campaign(
    plan: Plan,
    meshes: list[ObjectMesh],
    log: TrialLog,
    jobs: int = 1,
    minutes: float = np.inf,
    start_progress: Callable[[int], Callable[[int], object]] = lambda total: lambda done: None,
) -> tuple[list[dict], int]:
    """Run what the log does not hold yet; returns all trials of the plan that are done, and how many are not.

    Seeds come outermost, so that what a bounded run leaves out is spread over all objects. `start_progress` is called
    with the number of trials to run once slides and codebooks are there, what it returns with the number done since.
    Nothing new is started after `minutes`.
    """
    deadline = time.monotonic() + 60 * minutes
    workers = dataclasses.replace(plan, stock=dataclasses.replace(plan.stock), threads=1) if jobs > 1 else plan
    for _ in _map(_prepare, [(workers, mesh.path, deadline) for mesh in meshes], jobs):
        pass
    sizes = plan.codebook_sizes()
    digests = {(mesh.path, size): plan.stock.codebook_digest(mesh, size) for mesh, size in product(meshes, sizes)}
    wanted = {
        (mesh.path, variant, seed): [
            (plan.key(mesh, digests[mesh.path, VARIANTS[variant].codebook_size], labels), labels)
            for slide, init in product(plan.slides, plan.inits)
            for labels in [plan.labels(mesh, variant, slide, init, seed)]
        ]
        for seed, mesh, variant in product(plan.seeds, meshes, plan.variants)
    }
    units = []
    for (path, variant, _), trials in wanted.items():
        if open_ := [trial for trial in trials if log.get(trial[0]) is None]:
            units.append((workers, _Unit(path, variant, open_), deadline))
    progress = start_progress(sum(len(unit.trials) for _, unit, _ in units))
    for key, trial in _map(_run_unit, units, jobs):
        log.add(key, trial)
        progress(1)
    keys = [key for trials in wanted.values() for key, _ in trials]
    done = [trial for key in keys if (trial := log.get(key)) is not None]
    return done, len(keys) - len(done)


def likelihood_levels(plan: Plan, mesh: ObjectMesh, log: TrialLog) -> list[int]:
    """Counts of the levels at which single touches of the plan's slides over an object put their true poses."""
    networks = plan.stock.describe()
    digest = plan.stock.codebook_digest(mesh)
    content = [mesh.sha256, networks, digest, plan.stock.length, plan.slides, _filter_code()]
    key = key_of({"likelihood": content, "settings": [plan.config.temperature, plan.config.outlier]})
    if (entry := log.get(key)) is None:
        codes, poses = [], []
        for slide in plan.slides:
            sequence, touches = plan.stock.touches(mesh, slide)
            for frame in touches.frames(sequence, stride=5):
                if frame.felt.in_contact:
                    codes.append(frame.felt.code)
                    poses.append(frame.truth)
        entry = {"counts": likelihood_counts(plan.stock.codebook(mesh), codes, np.array(poses), plan.config)}
        log.add(key, entry)
    return entry["counts"]


def _map(function: Callable, arguments: list[tuple], jobs: int) -> Iterator:
    """Results in any order; in this process where there is no use for more."""
    if jobs == 1 or len(arguments) < 2:
        for one in arguments:
            yield from function(*one)
        return
    # not forked: threads of the inference engine do not survive it
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(arguments)), mp_context=context) as pool:
        for future in as_completed([pool.submit(_as_list, function, one) for one in arguments]):
            yield from future.result()


def _as_list(function: Callable, arguments: tuple) -> list:
    return list(function(*arguments))


def _prepare(plan: Plan, path: Path, deadline: float) -> Iterator[None]:
    """Make what the trials on one object need, as far as it is not there."""
    mesh = ObjectMesh.load(path)
    plan.stock.symmetry(mesh)
    for size in plan.codebook_sizes():
        plan.stock.codebook(mesh, size)
    for slide in plan.slides:
        if time.monotonic() < deadline:
            plan.stock.touches(mesh, slide)
    yield from ()


def _run_unit(plan: Plan, unit: _Unit, deadline: float) -> Iterator[tuple[str, dict]]:
    """Run the trials of a unit until the deadline."""
    if time.monotonic() >= deadline:
        return
    mesh = ObjectMesh.load(unit.mesh)
    symmetry = plan.stock.symmetry(mesh)
    variant = VARIANTS[unit.variant]
    codebook = plan.stock.codebook(mesh, variant.codebook_size)
    short = ShortCodes(codebook.codes, variant.code_length) if variant.code_length else None
    particle_filter = variant.filter(mesh, short.codebook(codebook) if short else codebook, plan.config, plan.threads)

    def frames(slide: int) -> list[TrialFrame]:
        plain = _frames(plan, mesh, slide)
        return [short.frame(frame) for frame in plain] if short else plain

    def trial(frames: list[TrialFrame], labels: dict) -> dict:
        particle_filter.reset(labels["seed"])
        TrialPlan(labels["init"], plan.beta).start(particle_filter, mesh, frames[0].truth)
        return labels | run_trial(frames, particle_filter, symmetry=symmetry, series=False)

    frames_of: dict[int, list[TrialFrame]] = {}
    for key, labels in unit.trials:
        if time.monotonic() >= deadline:
            return
        slide = labels["slide"]
        if slide not in frames_of:
            frames_of[slide] = frames(slide)
        yield key, trial(frames_of[slide], labels)


def _frames(plan: Plan, mesh: ObjectMesh, slide: int) -> list[TrialFrame]:
    """Frames of the trials on one slide, disturbed as the plan says."""
    sequence, touches = plan.stock.touches(mesh, slide)
    frames = touches.frames(sequence, plan.stride)
    disturb = DISTURBANCES.get(plan.protocol)
    return disturb(frames, np.random.default_rng(slide)) if disturb else frames


@cache
def _filter_code() -> str:
    packages = [Path(package.__file__).parent for package in (midastouch_filter, midastouch_kernels)]
    return source_digest(*packages, Path(paper_filter.__file__))
