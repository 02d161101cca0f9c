"""A recorded run read back from its bag: one snapshot, from which pictures are drawn, per frame that was answered."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.message_arrays import (
    covariance_from_msg,
    image_from_msg,
    point_from_msg,
    pose_from_msg,
    poses_from_msgs,
    probabilities_from_msg,
    transform_from_msg,
)
from midastouch_common.pose_metric import particle_rmse
from midastouch_perception.symmetry.group import Symmetry

from ..progress import progress_bar
from .images import read_bag
from .messages import header_stamp_ns
from .reader import bag_messages, message_counts

STATUS, MODES, PARTICLES, POSE = "/filter_status", "/pose_modes", "/particles", "/pose"
OBJECTS = "/object_hypotheses"
CODE, PENETRATION, DIAGNOSTICS = "/tactile/code", "/tactile/penetration", "/diagnostics"


class NoResults(InputError):
    """Raised if a bag has no frame with a result."""


@dataclasses.dataclass(frozen=True)
class RunRecord:
    """A run: snapshots in order of time, node_ms: mean work per frame by node."""

    snapshots: list[Snapshot]
    node_ms: dict[str, float]

    def since_change(self, seconds: float) -> RunRecord:
        """Return the last `seconds`, timed from their begin on, without the probabilities of objects, as if the object
        had been given."""
        begin = self.snapshots[-1].time - seconds
        timed = ((one, one.time - begin) for one in self.snapshots)
        last = [dataclasses.replace(one, time=time, objects={}) for one, time in timed if time >= 0]
        return dataclasses.replace(self, snapshots=last)


def read_run(path: str | Path) -> RunRecord:
    """Read a bag with the inputs and the results of a run.

    If the truth is known, each pose is replaced by the one nearest to the truth among its equivalents under the
    object's symmetry.

    Parameters
    ----------
    path
        The bag. Ground truth, poses, codes and penetration may be missing.

    Raises
    ------
    InputError
        The bag cannot be read; `NoResults` if it holds no frame with a result.
    """
    topics = {STATUS, MODES, PARTICLES, POSE, CODE, PENETRATION, OBJECTS, DIAGNOSTICS}
    counts = {topic.name: number for topic, number in message_counts(path).items() if number and topic.name in topics}
    no_results = NoResults(
        f"{path}: no frame with a status, modes and particles of the same stamp: no results; replay it, and record "
        f"that with the node recorder (how to play it: midastouch inspect-bag {path})"
    )
    if not counts.keys() >= {STATUS, MODES, PARTICLES}:
        raise no_results
    found: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in topics}
    messages, total = bag_messages(path, counts), sum(counts.values())  # in one pass: each reads the whole file
    for message in progress_bar(iterable=messages, desc=f"reading {Path(path).name}", unit="message", total=total):
        found[message.topic].append((header_stamp_ns(message.data), message.content))
    results = {topic: dict(messages) for topic, messages in found.items()} | {STATUS: answers(found[STATUS])}
    snapshots, start, seen, objects = [], None, set(), {}
    for frame in read_bag(path):
        start = frame.stamp_ns if start is None else start
        stamp = frame.stamp_ns
        if stamp in seen:  # recorded twice
            continue
        seen.add(stamp)
        if (detections := results[OBJECTS].get(stamp)) is not None:
            objects = probabilities_from_msg(detections)
        if not all(stamp in results[topic] for topic in (STATUS, MODES, PARTICLES)):
            continue
        status, pose = results[STATUS][stamp], results[POSE].get(stamp)
        snapshot = Snapshot(
            frame=len(seen) - 1,
            time=1e-9 * (stamp - start),
            truth=frame.object_from_gel_true,
            particles=poses_from_msgs(results[PARTICLES][stamp].poses),
            modes=[
                RecordedMode(float(one.weight), pose_from_msg(one.pose.pose), covariance_from_msg(one.pose.covariance))
                for one in results[MODES][stamp].modes
            ],
            estimate=None if pose is None else pose_from_msg(pose.pose.pose),
            image=frame.image,
            penetration=None if (image := results[PENETRATION].get(stamp)) is None else image_from_msg(image),
            code=np.asarray(code.code) if (code := results[CODE].get(stamp)) and code.in_contact else None,
            state=status.state,
            objects=objects,
            symmetry=_symmetry(results[MODES][stamp]),
            n_particles=int(status.n_particles),
            filter_ms=float(np.sum(status.stage_ms)),
        )
        snapshots.append(_nearest_to_truth(snapshot))
    if not snapshots:
        raise no_results
    return RunRecord(snapshots, _node_times(found[DIAGNOSTICS]))


def by_stamp(path: str | Path, topic: str) -> Iterator[tuple[int, Any]]:
    """Yield (header stamp [ns], deserialised message) for each message on a topic of a bag."""
    for message in bag_messages(path, {topic}):
        yield header_stamp_ns(message.data), message.content


def answers(statuses: Iterable[tuple[int, Any]]) -> dict[int, Any]:
    """Return the first status of each stamp [ns] that is an answer, not the state `waiting`."""
    found: dict[int, Any] = {}
    for stamp, status in statuses:
        if status.state != status.STATE_WAITING:
            found.setdefault(stamp, status)
    return found


def _symmetry(modes: Any) -> Symmetry:
    transforms = np.array([transform_from_msg(motion) for motion in modes.symmetries]).reshape(-1, 4, 4)
    axis, centre = point_from_msg(modes.symmetry_axis), point_from_msg(modes.symmetry_centre)
    return Symmetry(transforms, modes.symmetry_free, axis, centre)


def _nearest_to_truth(one: Snapshot) -> Snapshot:
    """Replace each pose by its symmetric equivalent that is nearest to the truth."""
    if one.truth is None or one.symmetry.trivial:
        return one

    def nearest(poses: np.ndarray) -> np.ndarray:
        return one.symmetry.nearest(poses, one.truth)

    modes = []
    for mode in one.modes:
        (pose,) = nearest(mode.pose[None])
        turn = se3.turn(pose[:3, :3] @ mode.pose[:3, :3].T)
        modes.append(RecordedMode(mode.weight, pose, turn @ mode.covariance @ turn.T))
    estimate = None if one.estimate is None else nearest(one.estimate[None])[0]
    return dataclasses.replace(one, particles=nearest(one.particles), modes=modes, estimate=estimate)


def _node_times(diagnostics: Iterable[tuple[int, Any]]) -> dict[str, float]:
    """Return the mean work per frame [ms] of each node that reports its rate and time in diagnostics by stamp."""
    work: dict[str, list[tuple[float, float]]] = {}
    for _, message in diagnostics:
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if "mean_ms" in values and float(values["rate_hz"]) > 0:
                entry = float(values["rate_hz"]), float(values["mean_ms"])
                work.setdefault(status.name.split(":")[0], []).append(entry)
    return {node: float(np.average([m for _, m in w], weights=[r for r, _ in w])) for node, w in work.items()}


@dataclasses.dataclass(frozen=True)
class RecordedMode:
    """One mode: its fraction of the particle mass, pose (4, 4) `T_obj_gel` and covariance (6, 6), REP-103
    order."""

    weight: float
    pose: np.ndarray
    covariance: np.ndarray


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """The filter and its input at one frame.

    frame: index in the sequence; time [s]: since its start; truth (4, 4): `T_obj_gel`, None if it is not known;
    particles (N, 4, 4): drawn by weight; modes: heaviest first; estimate (4, 4): the published pose, None before the
    first; image (H, W, 3): uint8; penetration (h, w): m, None if it was not recorded; code (D,): None without contact;
    state: of the filter; objects: probability of each candidate object by name, empty if the object was given;
    symmetry: of the object that the filter believes is touched; n_particles: hypotheses; filter_ms: work of the filter.
    Pictures of the report need the truth and the penetration; every demo has both.
    """

    frame: int
    time: float
    truth: np.ndarray | None
    particles: np.ndarray
    modes: list[RecordedMode]
    estimate: np.ndarray | None
    image: np.ndarray
    penetration: np.ndarray | None
    code: np.ndarray | None
    state: str
    objects: Mapping[str, float] = dataclasses.field(default_factory=dict)
    symmetry: Symmetry = dataclasses.field(default_factory=Symmetry)
    n_particles: int = 0
    filter_ms: float = 0.0


def moments(run: list[Snapshot], count: int) -> list[Snapshot]:
    """Choose at most `count` snapshots of a run: the first, the last, and more of them while the error falls fast.

    They are evenly spaced on a scale that counts frames and the fall of the particles' log error half each.
    """
    error = np.array([particle_rmse(s.particles, s.truth)[0] for s in run])
    fallen = -np.log(np.minimum.accumulate(np.maximum(error, 1e-6)))
    clock = np.linspace(0, 1, len(run))
    if fallen[-1] > fallen[0]:
        clock = 0.5 * clock + 0.5 * (fallen - fallen[0]) / (fallen[-1] - fallen[0])
    chosen = np.searchsorted(clock, np.linspace(0, clock[-1], count))
    return [run[i] for i in np.unique(np.minimum(chosen, len(run) - 1))]
