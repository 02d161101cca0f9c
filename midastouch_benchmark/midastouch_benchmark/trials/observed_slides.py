"""Trials of the filter with and without a budget over the same slides: the path after which each knows the pose.

Without a budget it is the ideal observer: at the first touch, and after each lift, it aligns every pose of the
codebook, and at each keyframe every hypothesis that matters. It knows all that can be known with the filter's own
measurement model.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.filter import ParticleFilter

from ..evidence import fingerprint
from .cache import Cache
from .disturbances import Disturbed, UndisturbedSlide
from .protocols import PROTOCOLS
from .sequence_trials import start_filter
from .trial import Event, TrialFrame, run_trial
from .trial_log import TrialLog, Workforce, key_of, make_books, run_open, source_digest
from .yardstick import Yardstick

EVIDENCE = ("maps", "codes")
"""Kinds of evidence with which the observer compares poses."""
OBSERVED = ("uniform", "plain", "lift", "kidnap")
"""Protocols in which the object rests between lifts."""
AFTER_EVENT = 20
"""Frames from an event to the check whether the pose is known again."""

_LIMITED = "filter"


@dataclasses.dataclass(frozen=True)
class Answer:
    """Answer at a frame. frame: position among the frames; path_m: so far; probability: of the published pose; sure:
    whether the state is `converged`; right: whether the pose is right."""

    frame: int
    path_m: float
    probability: float
    sure: bool
    right: bool


@dataclasses.dataclass(frozen=True)
class ObservedPlan:
    """Settings of a run. cache: of the protocol's slides; config: of the filter; evidence: some of `EVIDENCE`; slides:
    their numbers; protocol: one of `OBSERVED`."""

    cache: Cache
    config: FilterConfig
    evidence: tuple[str, ...] = EVIDENCE
    slides: tuple[int, ...] = (0, 1, 2, 3, 4)
    protocol: str = "uniform"

    def observer(self, evidence: str) -> FilterConfig:
        """Return settings of the filter without a budget, which compares poses with one of `EVIDENCE`."""
        every = max(self.config.max_particles, self.cache.codebook_size)
        maps = evidence == "maps"
        return dataclasses.replace(self.config, alignments_per_second=0, max_particles=every, refinement=maps)

    def describe(self) -> dict:
        """Return the settings for the JSON."""
        protocol = PROTOCOLS[self.protocol]
        return {
            "evidence": self.evidence,
            "slides": self.slides,
            "protocol": self.protocol,
            "init": protocol.starts[0],
            "beta": protocol.beta,
            "slide_length_m": self.cache.slides.followed,
            "codebook_size": self.cache.codebook_size,
            "networks": self.cache.describe(),
            "filter": dataclasses.asdict(self.config),
        }

    def key(self, mesh: ObjectMesh, labels: dict) -> str:
        """Return the key of everything that the trial with these labels depends on."""
        depends_on = self.describe() | {"slides": self.cache.slides.name, "mesh": mesh.sha256}
        depends_on |= {"code": source_digest(Path(__file__)), "codebook": self.cache.codebook_digest(mesh)}
        return key_of(labels | depends_on | {"fingerprint": fingerprint.of_estimates()})


def chosen_observed(protocol: str) -> str:
    """Return the protocol's name; InputError if the observer is not made for it."""
    if protocol not in OBSERVED:
        raise InputError(f"--protocol {protocol}: not one that can be observed; there are {', '.join(OBSERVED)}")
    return protocol


def run_observed(
    plan: ObservedPlan, meshes: list[ObjectMesh], log: TrialLog, workforce: Workforce
) -> tuple[list[dict], int]:
    """Run the trials that the log does not hold yet, as `run_open`; slides come outermost, so that the trials that a
    bounded run leaves out are spread over all objects."""
    make_books(plan.cache, [mesh.path for mesh in meshes], workforce.cluster)
    units = [
        ((plan, mesh.path), {plan.key(mesh, labels): labels})
        for slide, mesh in product(plan.slides, meshes)
        for labels in [{"object": mesh.name, "slide": slide, "protocol": plan.protocol}]
    ]
    return run_open(_run, units, log, workforce)


def _run(plan: ObservedPlan, path: Path, trials: dict[str, dict]) -> dict[str, dict]:
    """Run trials on one object, given as labels by key, and return the labels with the results.

    frames: their number; event_at: position of the first frame after the event; filter and, by evidence, observers: as
    `found_out`, with the columns probability and right of all answers.
    """
    mesh, protocol, out = ObjectMesh.load(path), PROTOCOLS[plan.protocol], {}
    codebook = plan.cache.codebook(mesh)
    yardstick = Yardstick.of(mesh, plan.cache.symmetry(mesh).exact)
    settings = {_LIMITED: plan.config} | {name: plan.observer(name) for name in plan.evidence}
    filters = {name: ParticleFilter(mesh, codebook, config) for name, config in settings.items()}
    for key, labels in trials.items():
        slide = labels["slide"]
        scene = protocol.disturb(UndisturbedSlide(plan.cache.frames(mesh, slide), np.random.default_rng(slide)))
        found = {}
        for name, running in filters.items():
            running.reset(0)
            start_filter(running, mesh, scene.frames[0].truth, protocol.starts[0], protocol.beta)
            given = answers(running, scene, yardstick)
            columns = {column: [getattr(each, column) for each in given] for column in ("probability", "right")}
            found[name] = found_out(given, scene.event) | {"answers": columns}
        out[key] = labels | {
            "frames": len(scene.frames),
            "event_at": scene.event.end if scene.event else None,
            "filter": found.pop(_LIMITED),
            "observers": found,
        }
    return out


def answers(particle_filter: ParticleFilter, scene: Disturbed, yardstick: Yardstick) -> list[Answer]:
    """Return the answers of a started filter at the frames in contact."""
    given: list[Answer] = []
    paths = path_along(scene.frames)

    def watch(frame: TrialFrame, estimate: Estimate, _: object) -> None:
        right = bool(yardstick.right(estimate.pose[None], frame.truth)[0])
        k, status = len(given), estimate.status
        given.append(Answer(k, float(paths[k]), status.mode_mass, status.state == CONVERGED, right))

    run_trial(scene.frames, particle_filter, watch, yardstick, series=False)
    return [answer for answer, frame in zip(given, scene.frames, strict=True) if frame.measurement.in_contact]


def found_out(answers: Sequence[Answer], event: Event | None) -> dict:
    """Return where the pose becomes known: from there to the end, or to the event, all answers are sure and right.

    known_frame, known_m: that frame, and its path from the start, None if never; again_m: path from the event until the
    pose is known to the end, None if it is not; known_soon: whether it is known `AFTER_EVENT` frames after the event,
    None without an event, or if the slide ends before; sure, sure_right: numbers of sure answers, and of right ones of
    these.
    """
    before = [answer for answer in answers if event is None or answer.frame < event.start]
    after = [answer for answer in answers if event is not None and answer.frame >= event.end]
    known, again = _known_from(before), _known_from(after)
    soon = [answer for answer in after if answer.frame <= event.end + AFTER_EVENT]
    asked = bool(after) and after[-1].frame >= event.end + AFTER_EVENT
    sure = [answer for answer in answers if answer.sure]
    return {
        "known_frame": known.frame if known else None,
        "known_m": known.path_m if known else None,
        "again_m": again.path_m - after[0].path_m if again else None,
        "known_soon": bool(soon) and soon[-1].sure and soon[-1].right if asked else None,
        "sure": len(sure),
        "sure_right": sum(answer.right for answer in sure),
    }


def _known_from(answers: Sequence[Answer]) -> Answer | None:
    """Return the first answer from which all are sure and right to the last; None if the last is not."""
    found = None
    for answer in reversed(answers):
        if not (answer.sure and answer.right):
            break
        found = answer
    return found


def path_along(frames: Sequence[TrialFrame]) -> np.ndarray:
    """Return the true path (N,) [m] of the gel up to each frame."""
    positions = np.array([frame.truth[:3, 3] for frame in frames])
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1)))
