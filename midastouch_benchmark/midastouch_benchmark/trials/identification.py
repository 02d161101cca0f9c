"""Trials of identification: slides over each object of a catalogue, with it and without it in the catalogue."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.motion_model import Odometry
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.identification.catalogue import Catalogue, Entry, read_catalogue
from midastouch_filter.identification.catalogue_localiser import CatalogueLocaliser
from midastouch_filter.identification.identity import UNKNOWN

from ..evidence import fingerprint
from .cache import Cache
from .trial import TrialFrame, with_odometry
from .trial_log import Campaign, source_digest
from .yardstick import Yardstick

ASKED_AT_M = (0.05, 0.1, 0.15, 0.2, 0.25)
"""Paths [m] at which probabilities are kept, in addition to those at the end."""


@dataclasses.dataclass(frozen=True)
class IdentityPlan(Campaign):
    """Settings of a run. cache; config: of the filter; slides: their numbers; catalogue: mesh files of its objects."""

    cache: Cache
    config: FilterConfig
    slides: tuple[int, ...]
    catalogue: tuple[Path, ...]
    LOG_NAME = "identifications.jsonl"
    UNIT = "slide"

    def describe(self) -> dict:
        """Return the settings for the JSON."""
        return {
            "slides": self.slides,
            "slide_length_m": self.cache.slides.followed,
            "codebook_size": self.cache.codebook_size,
            "networks": self.cache.describe(),
            "filter": dataclasses.asdict(self.config),
            "trial_code": source_digest(Path(__file__)),
            "fingerprint": fingerprint.of_estimates(),
        }

    def rounds(self) -> list[list[dict]]:
        """Return the labels of the slides."""
        return [[{"slide": slide}] for slide in self.slides]

    def depends_on(self, mesh: ObjectMesh) -> dict:
        """Return everything on which a trial depends, except its labels."""
        return {
            "identify": self.describe() | {"slides": self.cache.slides.name},
            "catalogue": books_of(self.cache, self.catalogue),
        }

    def trial(self, mesh: ObjectMesh, labels: dict) -> dict:
        """Return the `trials` of a slide: with the object in the catalogue and, if there are others, without."""
        catalogue, slide = catalogue_of(self.cache, self.catalogue, self.config), labels["slide"]
        entry = catalogue.entry(catalogue.duplicates.get(mesh.name, mesh.name))
        frames = self.cache.frames(entry.mesh, slide)
        labels = {"object": entry.name, "slide": slide, "in_catalogue": True, "objects": len(catalogue)}
        trials = [labels | identify(catalogue, frames, entry.name, self.config)]
        if len(catalogue) > 1:
            others = catalogue.without(entry.name)
            labels |= {"in_catalogue": False, "objects": len(others)}
            trials.append(labels | identify(others, frames, UNKNOWN, self.config))
        alone = ParticleFilter(entry.mesh, self.cache.codebook(entry.mesh), self.config, slide)
        trials[0] |= _alone(alone, frames, entry)
        return {"trials": trials}


@cache
def books_of(cache: Cache, paths: tuple[Path, ...]) -> list[list[str]]:
    """Return what trials over a catalogue of these mesh files depend on."""
    return sorted([mesh.sha256, cache.codebook_digest(mesh)] for mesh in map(ObjectMesh.load, paths))


@cache
def catalogue_of(cache: Cache, paths: tuple[Path, ...], config: FilterConfig) -> Catalogue:
    """Return the catalogue of the objects of these mesh files."""
    books = [cache.codebook_path(ObjectMesh.load(path)) for path in paths]
    return read_catalogue(books, lambda path: None, config, cache.sensor)


def identify(catalogue: Catalogue, frames: Iterable[TrialFrame], truth: str, config: FilterConfig) -> dict:
    """Run a slide over an object that is not named; truth: the right answer.

    Returns answer, right, and confidence, its probability, at the end; asked: [path m, confidence, right] on the way;
    right_from_m: path from which the answer is right until the end, None if the last is wrong; length_m; pose_right:
    the object is right, the state converged and the published pose right (`Yardstick`); cpu_ms: of a frame, without the
    networks.
    """
    localiser, given = CatalogueLocaliser(catalogue, config, seed=0), []
    cpu, path, stamp = 0.0, 0.0, 0
    for frame, odometry in with_odometry(frames):
        start, stamp = time.process_time(), stamp + round(1e9 * (frame.seconds or 0.0))
        estimate = localiser.process(frame.measured, frame.measurement, frame.others, stamp)
        cpu += time.process_time() - start
        identity = localiser.identity
        path += 0.0 if odometry is None else Odometry.from_matrix(odometry).distance
        given.append([path, max(identity.unknown, identity.leading.probability), identity.answer == truth])
    wrong = [k for k, (_, _, right) in enumerate(given) if not right]
    since = wrong[-1] + 1 if wrong else 0
    found = truth != UNKNOWN and localiser.object.name == truth
    return {
        "answer": identity.answer,
        "right": given[-1][2],
        "confidence": given[-1][1],
        "asked": [next(each for each in given if each[0] >= at) for at in ASKED_AT_M if at <= path],
        "right_from_m": given[since][0] if since < len(given) else None,
        "length_m": path,
        "pose_right": found and _is_right(estimate, frame, catalogue.entry(truth)),
        "cpu_ms": 1e3 * cpu / len(given),
    }


def right_answer(catalogue: Catalogue, name: str) -> str:
    """Return the right answer on an object: its name, or that of an object of the same shape, in the catalogue; if
    neither is there, `UNKNOWN`."""
    name = catalogue.duplicates.get(name, name)
    return name if name in [entry.name for entry in catalogue.entries] else UNKNOWN


def _alone(particle_filter: ParticleFilter, frames: list[TrialFrame], entry: Entry) -> dict:
    """Return alone_cpu_ms of a frame and alone_pose_right, as in `identify`, of the filter that is given the object."""
    particle_filter.initialise_uniform()
    start = time.process_time()
    for frame, odometry in with_odometry(frames):
        estimate = particle_filter.step(odometry, frame.measurement, frame.others, frame.seconds)
    cpu = 1e3 * (time.process_time() - start) / len(frames)
    return {"alone_cpu_ms": cpu, "alone_pose_right": _is_right(estimate, frames[-1], entry)}


def _is_right(estimate: Estimate | None, frame: TrialFrame, entry: Entry) -> bool:
    """Return whether the state is converged, and the published pose on the object right."""
    if estimate is None or estimate.status.state != CONVERGED:
        return False
    yardstick = Yardstick.of(entry.mesh, entry.model.symmetry.exact)
    return bool(yardstick.right(estimate.pose[None], frame.truth)[0])
