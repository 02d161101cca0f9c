"""Grasps without sliding: one to four contacts at once, held still, then others elsewhere.

A grasp's contacts are as many frames of a sequence; the first is that of the finger whose gel is localised.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from midastouch_bringup.datasets.slide_simulation import simulate_grasp_sequence
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import closest_mode_error, pose_errors
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.touch import Measurement
from midastouch_perception.simulation.grasp import CONTACTS

from ..statistics.intervals import Figures
from .cache import Cache
from .disturbances import Disturbed, Scene
from .trial import FRAME_TIME, AnyFilter, TrialFrame, Yardstick

_HELD_FRAMES = 10  # frames, half a second
_HEIGHT = 0.02  # m, of the open hand on its way to the next grasp


@dataclasses.dataclass(frozen=True)
class GraspCache(Cache):
    """A cache whose sequences are grasps."""

    def _simulate(self, mesh: ObjectMesh, number: int, path: Path) -> None:
        simulate_grasp_sequence(mesh, self.networks.sensor, self.slides.grasps, number, path, True)


def grasp(scene: Scene) -> Disturbed:
    """Each grasp is held still; then the hand opens, and goes to the next one.

    The arm's poses tell the first finger's motion, with their error; that of a further finger's pose relative to the
    first one is its own.
    """
    frames: list[TrialFrame] = []
    for first, *others in zip(*(scene.frames[k::CONTACTS] for k in range(CONTACTS)), strict=True):
        if frames:
            frames += [_open(frames[-1]), _open(first)]
        back = se3.inverse(first.truth)
        fingers = {
            f"finger_{k}": dataclasses.replace(other.measurement, T_gel_finger=back @ other.measured)
            for k, other in enumerate(others, 2)
        }
        frames += [dataclasses.replace(first, others=fingers, seconds=FRAME_TIME)] * _HELD_FRAMES
    return Disturbed(frames)


def _open(frame: TrialFrame) -> TrialFrame:
    """The hand above a place that it grasps, before or after."""
    up = se3.make(np.eye(3), np.array([0.0, 0.0, _HEIGHT]))
    air = {"measurement": Measurement(in_contact=False), "ms": {}, "others": {}, "seconds": FRAME_TIME}
    return dataclasses.replace(frame, measured=frame.measured @ up, truth=frame.truth @ up, **air)


class GraspRecord:
    """What the filter believes at the end of each grasp; an `Observer` of a trial."""

    def __init__(self, yardstick: Yardstick):
        self._yardstick = yardstick
        self._rows: dict[int, dict] = {}  # by the index of the grasp's frame

    def __call__(self, frame: TrialFrame, estimate: Estimate, particle_filter: AnyFilter) -> None:
        if not frame.measurement.in_contact:
            return
        truth, right = frame.truth, self._yardstick.right
        poses = self._yardstick.counted(particle_filter.poses, truth)
        modes = self._yardstick.counted(np.array([mode.pose for mode in estimate.modes]).reshape(-1, 4, 4), truth)
        pose = self._yardstick.counted(estimate.pose[None], truth)[0]
        distance, angle = closest_mode_error(modes, truth)
        self._rows[frame.index] = {
            "closest_mode_trans_mm": 1e3 * distance,
            "closest_mode_rot_deg": float(np.degrees(angle)),
            "found": bool(distance <= right),
            "share": float(particle_filter.weights[pose_errors(poses, truth)[0] <= right].sum()),
            "right": bool(pose_errors(pose, truth)[0] <= right),
            "converged": estimate.status.state == CONVERGED,
        }

    def result(self) -> dict:
        """For the trial: grasps, in their order, each with the error of the closest mode, whether that is `found`
        within the yardstick's limit, the belief's fraction within it, and whether the published pose is `right`."""
        return {"grasps": list(self._rows.values())}


def grasp_summary(trials: list[dict]) -> list[dict] | None:
    """After each grasp: trials, and with 95 % intervals the fractions of trials whose closest mode is `found`, whose
    pose is `right` and that are `converged` (of these `converged_wrong`), and the mean `share`; None without grasps."""
    if not all("grasps" in trial for trial in trials):
        return None
    figures = Figures.by_slide(trials)
    out = []
    for rows in zip(*(trial["grasps"] for trial in trials), strict=True):
        wrong = [row["converged"] and not row["right"] for row in rows]
        parts = {name: [row[name] for row in rows] for name in ("found", "share", "right", "converged")}
        parts["converged_wrong"] = wrong
        out.append({"trials": len(rows)} | {name: figures.fraction(part) for name, part in parts.items()})
    return out
