"""Accuracy: objects x variants x slides x starts x seeds, resumable, on a cluster."""

from __future__ import annotations

import dataclasses
import inspect
import socket
from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

import midastouch_filter
import midastouch_kernels
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_perception.objects import bundled_objects

from ..baselines import dead_reckoning, paper_filter, registration
from ..statistics.coverage import likelihood_counts
from .cache import Cache
from .disturbances import Disturbed, Scene
from .protocols import NEXT, PLAIN, PROTOCOLS, Protocol
from .sequence_trials import start_filter
from .trial import RECORD, TrialFrame, Yardstick, run_trial
from .trial_log import TrialLog, Workforce, key_of, make_books, run_open, source_digest
from .variants import VARIANTS, ShortCodes

_THREADS = 1  # of a filter: trials run beside each other


@dataclasses.dataclass(frozen=True)
class Plan:
    """What is run: cache; config, the default's filter settings; variants by name; inits, "paper" or "uniform"; beta,
    of the former; slides and seeds, their numbers; stride, every n-th frame; protocol, one of `PROTOCOLS`."""

    cache: Cache
    config: FilterConfig
    variants: tuple[str, ...]
    inits: tuple[str, ...] = ("paper", "uniform")
    beta: float = 1.0
    slides: tuple[int, ...] = (0, 1, 2, 3, 4)
    seeds: tuple[int, ...] = tuple(range(10))
    stride: int = 1
    protocol: str = PLAIN

    def describe(self) -> dict:
        """For the JSON; `midastouch report` shows it."""
        return {
            "inits": self.inits,
            "beta": self.beta,
            "slides": self.slides,
            "seeds": self.seeds,
            "stride": self.stride,
            "protocol": self.protocol,
            "slide_length_m": self.cache.slides.length,
            **PROTOCOLS[self.protocol].describe(),
            "codebook_size": self.cache.codebook_size,
            "networks": self.cache.describe(),
            "filter": dataclasses.asdict(self.config),
            "filter_code": _filter_code(),
            "threads": _THREADS,
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

    def key(self, mesh: ObjectMesh, foreign: ObjectMesh | None, codebook_digest: str, labels: dict) -> str:
        """Name of everything that the trial with these labels depends on; foreign, the other object touched."""
        variant = VARIANTS[labels["variant"]]
        depends_on = {
            "mesh": mesh.sha256,
            "settings": dataclasses.asdict(variant.config(self.config, 0)),
            "beta": self.beta,
            "stride": self.stride,
            "slides": self.cache.slides.name,
            "foreign": foreign.sha256 if foreign else None,
            "protocol_code": _protocol_code(PROTOCOLS[self.protocol]),
            **PROTOCOLS[self.protocol].describe(),
            "codebook": codebook_digest,
            "networks": self.cache.describe(),
            "filter_code": _filter_code(),
            "record": RECORD,
        }
        return key_of(labels | depends_on | variant.inputs)

    def codebook_sizes(self) -> list[int | None]:
        """Of all variants; None is the cache's own."""
        return list(dict.fromkeys(VARIANTS[name].codebook_size for name in self.variants))


def run_campaign(plan: Plan, meshes: list[ObjectMesh], log: TrialLog, workforce: Workforce) -> tuple[list[dict], int]:
    """Run what the log does not hold yet, as `run_open`; first the slides and codebooks that this needs.

    Seeds come outermost, so that what a bounded run leaves out is spread over all objects. Workers must see the cache's
    folder.
    """
    foreign = dict(zip((mesh.path for mesh in meshes), _foreign(PROTOCOLS[plan.protocol], meshes), strict=True))
    _make_cache(plan, meshes, {mesh.path for mesh in foreign.values() if mesh}, workforce)
    return run_open(_run_unit, _units(plan, meshes, foreign), log, workforce)


def _make_cache(plan: Plan, meshes: list[ObjectMesh], foreign: set[Path], workforce: Workforce) -> None:
    """Make what the trials need, as far as it is not there."""
    objects = {mesh.path for mesh in meshes}
    make_books(plan.cache, sorted(objects), workforce.cluster, tuple(plan.codebook_sizes()))
    touched = product(sorted(objects | foreign), plan.slides)
    for _ in workforce.cluster.map(_make_touches, [(plan.cache, *one) for one in touched], workforce.deadline):
        pass


def _units(
    plan: Plan, meshes: list[ObjectMesh], foreign: dict[Path, ObjectMesh | None]
) -> Iterator[tuple[tuple, dict[str, dict]]]:
    """One filter's work each: arguments of `_run_unit`, and the labels of the trials by their keys."""
    sizes, code = plan.codebook_sizes(), _filter_code()
    digests = {(mesh.path, size): plan.cache.codebook_digest(mesh, size) for mesh, size in product(meshes, sizes)}
    for seed, mesh, variant in product(plan.seeds, meshes, plan.variants):
        other, digest = foreign[mesh.path], digests[mesh.path, VARIANTS[variant].codebook_size]
        trials = [plan.labels(mesh, variant, slide, init, seed) for slide, init in product(plan.slides, plan.inits)]
        arguments = plan, mesh.path, other.path if other else None, variant, code
        yield arguments, {plan.key(mesh, other, digest, labels): labels for labels in trials}


def likelihood_levels(plan: Plan, mesh: ObjectMesh, log: TrialLog) -> list[int]:
    """Counts of the levels at which single touches of the plan's slides over an object put their true poses."""
    networks = plan.cache.describe()
    digest = plan.cache.codebook_digest(mesh)
    content = [mesh.sha256, networks, digest, plan.cache.slides.name, plan.slides, _filter_code()]
    key = key_of({"likelihood": content, "settings": [plan.config.temperature, plan.config.outlier]})
    if (entry := log.get(key)) is None:
        codes, poses = [], []
        for slide in plan.slides:
            sequence, touches = plan.cache.touches(mesh, slide)
            for frame in touches.frames(sequence, stride=5):
                if frame.measurement.in_contact:
                    codes.append(frame.measurement.code)
                    poses.append(frame.truth)
        entry = {"counts": likelihood_counts(plan.cache.codebook(mesh), codes, np.array(poses), plan.config)}
        log.add(key, entry)
    return entry["counts"]


def _foreign(protocol: Protocol, meshes: list[ObjectMesh]) -> list[ObjectMesh | None]:
    """For each object the other one that is touched; InputError if there is none."""
    if protocol.foreign == NEXT:
        if len(meshes) < 2:
            raise InputError("the wrong object cannot be touched with one object only; give two with --objects")
        return [*meshes[1:], meshes[0]]
    bundled = ObjectMesh.load(bundled_objects()[protocol.foreign]) if protocol.foreign else None
    return [bundled] * len(meshes)


def _make_touches(cache: Cache, path: Path, slide: int) -> None:
    cache.touches(ObjectMesh.load(path), slide)


def _run_unit(
    plan: Plan, path: Path, foreign_path: Path | None, variant_name: str, filter_code: str, trials: dict[str, dict]
) -> dict[str, dict]:
    """Trials of one variant on one object, `foreign_path` the other one's; what is given and returned, by key.

    InputError if this worker's code is not the campaign's.
    """
    if _filter_code() != filter_code:
        raise InputError(f"worker {socket.gethostname()}: has another version of the filter; install the same there")
    mesh = ObjectMesh.load(path)
    foreign = ObjectMesh.load(foreign_path) if foreign_path else None
    protocol, variant = PROTOCOLS[plan.protocol], VARIANTS[variant_name]
    yardstick = Yardstick(plan.cache.symmetry(mesh), protocol.right, protocol.modulo_symmetry)
    codebook = plan.cache.codebook(mesh, variant.codebook_size)
    short = ShortCodes(codebook.codes, variant.code_length) if variant.code_length else None
    particle_filter = variant.filter(mesh, short.codebook(codebook) if short else codebook, plan.config, _THREADS)

    @cache
    def scene(slide: int) -> Disturbed:
        disturbed = _disturbed(plan, mesh, foreign, slide)
        frames = [variant.fingers(frame) for frame in disturbed.frames]
        return dataclasses.replace(disturbed, frames=[short.frame(frame) for frame in frames] if short else frames)

    def trial(scene: Disturbed, labels: dict) -> dict:
        particle_filter.reset(labels["seed"])
        start_filter(particle_filter, mesh, scene.frames[0].truth, labels["init"], plan.beta)
        record = protocol.record(yardstick) if protocol.record else None
        out = run_trial(scene.frames, particle_filter, record, yardstick, series=False, event=scene.event)
        return labels | out | (record.result() if record else {})

    return {key: trial(scene(labels["slide"]), labels) for key, labels in trials.items()}


def _disturbed(plan: Plan, mesh: ObjectMesh, foreign: ObjectMesh | None, slide: int) -> Disturbed:
    """One slide as the plan's protocol has it."""

    def frames(mesh: ObjectMesh) -> list[TrialFrame]:
        sequence, touches = plan.cache.touches(mesh, slide)
        return touches.frames(sequence, plan.stride)

    scene = Scene(frames(mesh), np.random.default_rng(slide))
    if foreign:  # the cache's own codebook: all variants meet the same scene
        scene = dataclasses.replace(scene, foreign=frames(foreign), codebook=plan.cache.codebook(mesh))
    return PROTOCOLS[plan.protocol].disturb(scene)


@cache
def _filter_code() -> str:
    packages = [Path(package.__file__).parent for package in (midastouch_filter, midastouch_kernels)]
    return source_digest(*packages, *(Path(peer.__file__) for peer in (paper_filter, registration, dead_reckoning)))


@cache
def _protocol_code(protocol: Protocol) -> str:
    return source_digest(Path(inspect.getfile(protocol.disturb)))
