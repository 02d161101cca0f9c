"""Trials of the filter with and without a budget over the same slides: the path after which each knows the pose.

Without a budget it is the ideal observer: at the first touch, and after each lift, it aligns every pose of the
codebook, and at each keyframe every hypothesis that matters. It knows all that can be known with the filter's own
measurement model.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
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
from .trial_log import Campaign, source_digest
from .yardstick import Yardstick

EVIDENCE = ("maps", "codes")
"""Kinds of evidence with which the observer compares poses."""
OBSERVED = ("uniform", "plain", "lift", "kidnap")
"""Protocols in which the object rests between lifts."""
AFTER_EVENT = 20
"""Frames from an event to the check whether the pose is known again."""


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
class ObservedPlan(Campaign):
    """Settings of a run. cache: of the protocol's slides; config: of the filter; evidence: some of `EVIDENCE`; slides:
    their numbers; protocol: one of `OBSERVED`."""

    cache: Cache
    config: FilterConfig
    evidence: tuple[str, ...] = EVIDENCE
    slides: tuple[int, ...] = (0, 1, 2, 3, 4)
    protocol: str = "uniform"
    LOG_NAME = "observed.jsonl"
    UNIT = "slide"

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

    def rounds(self) -> list[list[dict]]:
        """Return the labels of the slides."""
        return [[{"slide": slide, "protocol": self.protocol}] for slide in self.slides]

    def depends_on(self, mesh: ObjectMesh) -> dict:
        """Return everything on which a trial depends, except its labels."""
        return self.describe() | {
            "slides": self.cache.slides.name,
            "code": source_digest(Path(__file__)),
            "codebook": self.cache.codebook_digest(mesh),
            "fingerprint": fingerprint.of_estimates(),
        }

    def trial(self, mesh: ObjectMesh, labels: dict) -> dict:
        """Run filter and observers over one slide.

        frames: their number; event_at: position of the first frame after the event; filter and, by evidence, observers:
        as `found_out`, with the columns probability and right of all answers.
        """
        protocol, slide = PROTOCOLS[self.protocol], labels["slide"]
        codebook, yardstick = self.cache.codebook(mesh), Yardstick.of(mesh, self.cache.symmetry(mesh).exact)
        scene = protocol.disturb(UndisturbedSlide(self.cache.frames(mesh, slide), np.random.default_rng(slide)))

        def found(config: FilterConfig) -> dict:
            running = ParticleFilter(mesh, codebook, config)
            running.reset(0)
            start_filter(running, mesh, scene.frames[0].truth, protocol.starts[0], protocol.beta)
            given = answers(running, scene, yardstick)
            columns = {column: [getattr(each, column) for each in given] for column in ("probability", "right")}
            return found_out(given, scene.event) | {"answers": columns}

        return {
            "frames": len(scene.frames),
            "event_at": scene.event.end if scene.event else None,
            "filter": found(self.config),
            "observers": {name: found(self.observer(name)) for name in self.evidence},
        }


def chosen_observed(protocol: str) -> str:
    """Return the protocol's name; InputError if the observer is not made for it."""
    if protocol not in OBSERVED:
        raise InputError(f"--protocol {protocol}: not one that can be observed; there are {', '.join(OBSERVED)}")
    return protocol


def answers(particle_filter: ParticleFilter, scene: Disturbed, yardstick: Yardstick) -> list[Answer]:
    """Return the answers of a started filter at the frames in contact."""
    given: list[Answer] = []
    steps = np.diff([frame.truth[:3, 3] for frame in scene.frames], axis=0)
    paths = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))

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
