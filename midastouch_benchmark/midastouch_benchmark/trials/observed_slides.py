"""The filter and the ideal observer over the same slides: from where on does either know where it is?"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_errors
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.pose_hypothesis import Prior
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.workers import Workers
from midastouch_filter.filter import ParticleFilter

from ..evidence import fingerprint
from . import ideal_observer
from .cache import Cache
from .disturbances import Disturbed, Scene
from .ideal_observer import EVIDENCE, KNOWN, Hypotheses, IdealObserver, Posterior, observe
from .protocols import PAPER, PROTOCOLS
from .sequence_trials import paper_start, start_filter
from .trial import Event, TrialFrame, run_trial
from .trial_log import TrialLog, Workforce, key_of, make_books, run_open, source_digest
from .yardstick import Yardstick

OBSERVED = ("uniform", "plain", "lift", "kidnap")
"""Protocols in which the object rests between lifts, as the observer takes it to."""
AFTER_EVENT = 20
"""Frames after an event at which it is asked whether the pose is known again."""

_NOTED = 0.01  # probability


@dataclasses.dataclass(frozen=True)
class Answer:
    """frame, position among the frames; path_m so far; probability of the answer, 1 and 0 for a filter that is
    converged or not; right, whether it is."""

    frame: int
    path_m: float
    probability: float
    right: bool

    @property
    def sure(self) -> bool:
        """Whether it is said to be known."""
        return self.probability >= KNOWN


@dataclasses.dataclass(frozen=True)
class ObservedPlan:
    """What is run: cache, of the protocol's slides; config of the filter; evidence, some of `EVIDENCE`; slides, their
    numbers; protocol, one of `OBSERVED`."""

    cache: Cache
    config: FilterConfig
    evidence: tuple[str, ...] = EVIDENCE
    slides: tuple[int, ...] = (0, 1, 2, 3, 4)
    protocol: str = "uniform"

    def describe(self) -> dict:
        """For the JSON."""
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
        """Name of everything that the trial with these labels depends on."""
        depends_on = self.describe() | {"slides": self.cache.slides.name, "mesh": mesh.sha256}
        depends_on |= {"code": source_digest(Path(__file__), Path(ideal_observer.__file__))}
        depends_on |= {"fingerprint": fingerprint.of_estimates(), "codebook": self.cache.codebook_digest(mesh)}
        return key_of(labels | depends_on)


def chosen_observed(protocol: str) -> str:
    """The protocol of that name; InputError for one that the observer is not made for."""
    if protocol not in OBSERVED:
        raise InputError(f"--protocol {protocol}: not one that can be observed; there are {', '.join(OBSERVED)}")
    return protocol


def run_observed(
    plan: ObservedPlan, meshes: list[ObjectMesh], log: TrialLog, workforce: Workforce
) -> tuple[list[dict], int]:
    """Run what the log does not hold yet, as `run_open`; slides come outermost, so that what a bounded run leaves out
    is spread over all objects."""
    make_books(plan.cache, [mesh.path for mesh in meshes], workforce.cluster)
    units = [
        ((plan, mesh.path), {plan.key(mesh, labels): labels})
        for slide, mesh in product(plan.slides, meshes)
        for labels in [{"object": mesh.name, "slide": slide, "protocol": plan.protocol}]
    ]
    return run_open(_run, units, log, workforce)


def _run(plan: ObservedPlan, path: Path, trials: dict[str, dict]) -> dict[str, dict]:
    """Trials on one object, by key: labels in, with what was found out.

    frames; event, position of the first frame after it; filter and, by evidence, observers: as `found_out`; of the
    latter also answers, `Answer` and what else is known of each keyframe, by columns, and left, as of `poses_left`.
    """
    mesh, protocol = ObjectMesh.load(path), PROTOCOLS[plan.protocol]
    codebook, noise = plan.cache.codebook(mesh), NoiseModel.of(plan.config)
    yardstick = Yardstick.of(mesh, plan.cache.symmetry(mesh).exact)
    particle_filter = ParticleFilter(mesh, codebook, plan.config)
    model = ObjectModel(mesh, codebook, plan.config, noise, Workers(plan.config.threads))
    start, out = protocol.starts[0], {}
    for key, labels in trials.items():
        slide = labels["slide"]
        scene = protocol.disturb(Scene(plan.cache.frames(mesh, slide), np.random.default_rng(slide)))
        truth = scene.frames[0].truth
        particle_filter.reset(0)
        start_filter(particle_filter, mesh, truth, start, protocol.beta)
        prior = Prior(truth, *paper_start(mesh, protocol.beta)) if start == PAPER else None
        observers = {}
        for name in plan.evidence:
            observer = IdealObserver(model, noise, yardstick, name, prior)
            observed = list(observe(observer, scene.frames))
            rows = judged(observed, scene.frames, yardstick)
            answers = [Answer(*(row[field.name] for field in dataclasses.fields(Answer))) for row in rows]
            columns = {column: [row[column] for row in rows] for column in (rows[0] if rows else ())}
            observers[name] = found_out(answers, scene.event) | {"answers": columns, "left": []}
            if observed:
                k, last = observed[-1]
                observers[name]["left"] = poses_left(last.hypotheses, scene.frames[k].truth, yardstick)
        out[key] = labels | {
            "frames": len(scene.frames),
            "event_at": scene.event.end if scene.event else None,
            "filter": found_out(_answers_of_filter(particle_filter, scene, yardstick), scene.event),
            "observers": observers,
        }
    return out


def poses_left(hypotheses: Hypotheses, truth: np.ndarray, yardstick: Yardstick) -> list[dict[str, float]]:
    """The poses that nothing has told apart, the most probable first: those that the yardstick does not take for one.

    distance_mm and angle_deg from the true pose (4, 4), modulo symmetry, and probability of each that has 1 % or more.
    """
    order = np.argsort(-hypotheses.probabilities, kind="stable")
    poses, probabilities = hypotheses.poses[order], hypotheses.probabilities[order]
    out = []
    while probabilities.sum() >= _NOTED:
        same = yardstick.right(poses, poses[0])
        distance, angle = pose_errors(yardstick.counted(poses[:1], truth), truth)
        one = {"distance_mm": 1e3 * float(distance[0]), "angle_deg": float(np.degrees(angle[0]))}
        out.append(one | {"probability": float(probabilities[same].sum())})
        poses, probabilities = poses[~same], probabilities[~same]
    noted = [one for one in out if one["probability"] >= _NOTED]
    return sorted(noted, key=lambda one: -one["probability"])


def _answers_of_filter(particle_filter: ParticleFilter, scene: Disturbed, yardstick: Yardstick) -> list[Answer]:
    """What a started filter says at each frame in contact."""
    said: list[Answer] = []
    paths = path_along(scene.frames)

    def watch(frame: TrialFrame, estimate: Estimate, _: object) -> None:
        right = estimate.pose is not None and bool(yardstick.right(estimate.pose[None], frame.truth)[0])
        k = len(said)
        said.append(Answer(k, float(paths[k]), float(estimate.status.state == CONVERGED), right))

    run_trial(scene.frames, particle_filter, watch, yardstick, series=False)
    return [answer for answer, frame in zip(said, scene.frames, strict=True) if frame.measurement.in_contact]


def found_out(answers: Sequence[Answer], event: Event | None) -> dict:
    """From where on it is known where the gel is: said, right, and so on to the end, or to the event.

    known_frame and known_m, path from the start, None if never; after the event again_m, path from there, None if not
    by the end, and known_soon, whether it is `AFTER_EVENT` frames later, None if there was no event or the slide ends
    before; sure and sure_right, numbers of answers that were said to be known, and of the right ones of these.
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
    """The first of those, to the last one, that are sure and right."""
    found = None
    for answer in reversed(answers):
        if not (answer.sure and answer.right):
            break
        found = answer
    return found


def path_along(frames: Sequence[TrialFrame]) -> np.ndarray:
    """True path (N,) [m] of the gel up to each frame."""
    positions = np.array([frame.truth[:3, 3] for frame in frames])
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1)))


def judged(observed: Iterable[tuple[int, Posterior]], frames: Sequence[TrialFrame], yardstick: Yardstick) -> list[dict]:
    """What `observe` found beside the truth, for the report.

    frame, position among the frames; path_m so far; probability of the most probable place, and whether that is right;
    true_probability, of the poses that are right; hypotheses that are left, and how many of them hold 99 %, credible.
    """
    rows, path = [], path_along(frames)
    for k, found in observed:
        true = yardstick.right(found.hypotheses.poses, frames[k].truth)
        rows.append(
            {
                "frame": k,
                "path_m": float(path[k]),
                "probability": found.probability,
                "right": bool(yardstick.right(found.pose[None], frames[k].truth)[0]),
                "true_probability": float(found.hypotheses.probabilities[true].sum()),
                "hypotheses": len(found.hypotheses),
                "credible": found.credible,
            }
        )
    return rows
