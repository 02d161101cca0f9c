"""Campaign on accuracy: objects x variants x slides x starts x seeds, resumable, by several workers."""

from __future__ import annotations

import dataclasses
import math
import socket
from functools import cache
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np

import midastouch_filter
import midastouch_kernels
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter import paper_filter
from midastouch_filter.core.config import FilterConfig
from midastouch_perception.objects import bundled_objects
from midastouch_tools.jobs import Workers

from ..baselines import registration
from ..evidence import fingerprint
from .cache import Cache
from .disturbances import Disturbed, UndisturbedSlide
from .protocols import NEXT, PLAIN, PROTOCOLS, Protocol
from .sequence_trials import start_filter
from .trial import RECORD, run_trial
from .trial_log import TrialLog, key_of, make_books, run_open, source_digest
from .variants import VARIANTS
from .yardstick import Yardstick

_METHODS = tuple(Path(method.__file__) for method in (paper_filter, registration))
THREADS = 1  # of a filter: trials run in parallel


@dataclasses.dataclass(frozen=True)
class Plan:
    """Settings of a campaign. cache; config: the default's filter settings; variants: by name; inits: "paper" or
    "uniform"; beta: of the former; slides, seeds: their numbers; stride: every n-th frame is used; protocol: one of
    `PROTOCOLS`."""

    cache: Cache
    config: FilterConfig
    variants: tuple[str, ...]
    inits: tuple[str, ...] = ("paper", "uniform")
    beta: float = 1.0
    slides: tuple[int, ...] = (0, 1, 2, 3, 4)
    seeds: tuple[int, ...] = tuple(range(10))
    stride: int = 1
    protocol: str = PLAIN
    UNIT: ClassVar[str] = "trial"

    def describe(self) -> dict:
        """Return the settings for the JSON; `midastouch report` shows them."""
        return {
            "inits": self.inits,
            "beta": self.beta,
            "slides": self.slides,
            "seeds": self.seeds,
            "stride": self.stride,
            "protocol": self.protocol,
            "slide_length_m": self.cache.slides.followed,
            "foreign": PROTOCOLS[self.protocol].foreign,
            "codebook_size": self.cache.codebook_size,
            "networks": self.cache.describe(),
            "filter": dataclasses.asdict(self.config),
            "threads": THREADS,
        }

    def key(self, mesh: ObjectMesh, foreign: ObjectMesh | None, codebook_digest: str, labels: dict) -> str:
        """Return the key of everything that the trial with these labels depends on; foreign: the other object."""
        variant = VARIANTS[labels["variant"]]
        depends_on = {
            "mesh": mesh.sha256,
            "settings": {} if variant.method else _unlike_defaults(variant.config(self.config, 0)),
            "beta": self.beta,
            "stride": self.stride,
            "slides": self.cache.slides.name,
            "foreign": foreign.sha256 if foreign else None,
            "codebook": codebook_digest,
            "networks": self.cache.describe(),
            "fingerprint": fingerprint.of_estimates(),
            "method": (variant.method, source_digest(*_METHODS) if variant.method else ""),
            "record": RECORD,
        }
        return key_of(labels | depends_on | variant.inputs)

    def run(self, meshes: list[ObjectMesh], workers: Workers, deadline: float = math.inf) -> tuple[list[dict], int]:
        """Run the trials that the log does not hold yet, as `run_open`; slides and codebooks that they need are made
        first.

        Seeds come outermost, so that the trials that a bounded run leaves out are spread over all objects. Workers must
        see the cache's folder. Raises InputError if the protocol needs another object, and there is none.
        """
        foreign = _foreign(PROTOCOLS[self.protocol], meshes)
        sizes = tuple(dict.fromkeys(VARIANTS[name].codebook_size for name in self.variants))  # None: the cache's own
        objects = {mesh.path for mesh in meshes}
        make_books(self.cache, sorted(objects), workers, sizes)
        touched = product(sorted(objects | {mesh.path for mesh in foreign if mesh}), self.slides)
        for _ in workers.map(_make_touches, [(self.cache, *one) for one in touched], deadline):
            pass
        units, code = [], _filter_code()
        digests = {(mesh.path, size): self.cache.codebook_digest(mesh, size) for mesh, size in product(meshes, sizes)}
        for seed, (mesh, other), variant in product(self.seeds, list(zip(meshes, foreign, strict=True)), self.variants):
            digest, trials = digests[mesh.path, VARIANTS[variant].codebook_size], {}
            for slide, init in product(self.slides, self.inits):
                labels = {"sequence": f"{mesh.name}/{slide:02d}", "object": mesh.name, "slide": slide, "seed": seed}
                labels |= {"init": init, "variant": variant, "protocol": self.protocol}
                trials[self.key(mesh, other, digest, labels)] = labels
            units.append(((self, mesh.path, other and other.path, variant, code), trials))
        return run_open(_run_unit, units, TrialLog(self.cache.folder / "trials.jsonl"), workers, deadline)


def _foreign(protocol: Protocol, meshes: list[ObjectMesh]) -> list[ObjectMesh | None]:
    """Return for each object the other one that is touched, None if the protocol has none."""
    if protocol.foreign == NEXT:
        if len(meshes) < 2:
            raise InputError("the wrong object cannot be touched with one object only; give two with --objects")
        return [*meshes[1:], meshes[0]]
    bundled = ObjectMesh.load(bundled_objects()[protocol.foreign]) if protocol.foreign else None
    return [bundled] * len(meshes)


def _make_touches(cache: Cache, path: Path, slide: int) -> None:
    cache.touches(ObjectMesh.load(path), slide)


def _run_unit(
    plan: Plan, path: Path, foreign_path: Path | None, variant_name: str, code: str, trials: dict[str, dict]
) -> dict[str, dict]:
    """Run trials of one variant on one object, given as labels by key, and return the labels with the results.

    foreign_path: mesh of the other object. InputError if this worker's code is not the campaign's.
    """
    if _filter_code() != code:
        raise InputError(f"worker {socket.gethostname()}: has another version of the filter; install the same there")
    mesh = ObjectMesh.load(path)
    foreign = ObjectMesh.load(foreign_path) if foreign_path else None
    protocol, variant = PROTOCOLS[plan.protocol], VARIANTS[variant_name]
    yardstick = Yardstick.of(mesh, plan.cache.symmetry(mesh).exact)
    codebook = variant.codebook(plan.cache.codebook(mesh, variant.codebook_size))
    particle_filter = variant.filter(mesh, codebook, plan.config, THREADS)
    scenes: dict[int, Disturbed] = {}
    out = {}
    for key, labels in trials.items():
        if (slide := labels["slide"]) not in scenes:
            frames = [[] if each is None else plan.cache.frames(each, slide, plan.stride) for each in (mesh, foreign)]
            # the cache's own codebook: all variants meet the same scene
            own = plan.cache.codebook(mesh) if foreign else None
            scene = protocol.disturb(UndisturbedSlide(frames[0], np.random.default_rng(slide), frames[1], own))
            scenes[slide] = dataclasses.replace(scene, frames=[variant.frame(frame) for frame in scene.frames])
        scene = scenes[slide]
        particle_filter.reset(labels["seed"])
        start_filter(particle_filter, mesh, scene.frames[0].truth, labels["init"], plan.beta)
        record = protocol.record(yardstick) if protocol.record else None
        trial = run_trial(scene.frames, particle_filter, record, yardstick, series=False, event=scene.event)
        out[key] = labels | trial | (record.result() if record else {})
    return out


@cache
def _filter_code() -> str:
    """Return a digest of the code of the filter, its kernels and the other methods, which all workers must share."""
    packages = [Path(package.__file__).parent for package in (midastouch_filter, midastouch_kernels)]
    return source_digest(*packages, *_METHODS)


def _unlike_defaults(config: FilterConfig) -> dict:
    """Return the settings that differ from the defaults, by name; the defaults are part of the fingerprint."""
    usual = dataclasses.asdict(FilterConfig())
    return {name: value for name, value in dataclasses.asdict(config).items() if value != usual[name]}
