"""Grasps in place of slides: held once by a thumb and two fingers, or pinched several times by two fingers."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.core.touch import Measurement
from midastouch_tools.datasets.slide_simulation import simulate_grasp_sequence, simulate_pinches

from .cache import Cache
from .disturbances import Disturbed, UndisturbedSlide, at_rest
from .trial import FRAME_TIME, AnyFilter, TrialFrame
from .yardstick import Yardstick

HOLDS = 0.5, 5.0
"""Times [s] at which the filter's belief about a grasp is judged; the grasp is held until the last of them."""
_PINCHES, _LASTS, _AWAY = 3, 40, 10  # number; frames of each, and between two of them
_OPENED = 0.03  # m that each finger moves away
PINCHED = tuple(FRAME_TIME * (k * (_LASTS + _AWAY) + _LASTS) for k in range(_PINCHES))
"""Times [s] at which pinches end, and are judged."""


@dataclasses.dataclass(frozen=True)
class GraspCache(Cache):
    """A cache whose sequences are grasps, with a frame for each contact."""

    def _simulate(self, mesh: ObjectMesh, number: int, path: Path) -> None:
        simulate_grasp_sequence(mesh, self.networks.sensor, number, path, True)


@dataclasses.dataclass(frozen=True)
class PinchCache(Cache):
    """A cache of pinches by two sensors: what they feel in pinch sequence k is kept as sequences 2 k and 2 k + 1."""

    def _simulate(self, mesh: ObjectMesh, number: int, path: Path) -> None:
        simulate_pinches(mesh, self.networks.sensor, number // 2, number % 2, _PINCHES, path)

    def frames(self, mesh: ObjectMesh, number: int, stride: int = 1) -> list[TrialFrame]:
        """Return a frame for each pinch."""
        thumb, finger = (super(PinchCache, self).frames(mesh, 2 * number + which) for which in range(2))
        return [_of_hand([first, other]) for first, other in zip(thumb, finger, strict=True)]


def _of_hand(contacts: list[TrialFrame]) -> TrialFrame:
    """Return the first finger's frame with the others' measurements, their poses relative to it as measured."""
    first, *others = contacts
    back = se3.inverse(first.truth)
    fingers = {
        f"finger_{k}": dataclasses.replace(other.measurement, T_gel_finger=back @ other.measured)
        for k, other in enumerate(others, 2)
    }
    return dataclasses.replace(first, others=fingers)


def grasp(scene: UndisturbedSlide) -> Disturbed:
    """Hold the hand still: poses and codes differ by the noise of joints and camera only.

    The pose of each further finger relative to the first one has a constant error.
    """
    held = _of_hand(scene.frames)
    return Disturbed([at_rest(held, scene.rng) for _ in range(round(HOLDS[-1] / FRAME_TIME))])


def pinch(scene: UndisturbedSlide) -> Disturbed:
    """Hold each pinch still, open, and go through the air to the next; the odometry reports it."""
    frames: list[TrialFrame] = []
    for k, pinched in enumerate(scene.frames):
        if k:
            opening = [_opened(scene.frames[k - 1], part) for part in np.linspace(0.2, 1.0, _AWAY // 2)]
            frames += opening + [_opened(pinched, part) for part in np.linspace(1.0, 0.2, _AWAY // 2)]
        frames += [at_rest(pinched, scene.rng) for _ in range(_LASTS)]
    return Disturbed([dataclasses.replace(frame, index=k, seconds=FRAME_TIME) for k, frame in enumerate(frames)])


def _opened(pinched: TrialFrame, fraction: float) -> TrialFrame:
    """Return a frame whose fingers have moved away by this fraction of their way."""
    away = se3.translation([0.0, 0.0, fraction * _OPENED])
    others = {
        name: Measurement(False, T_gel_finger=se3.inverse(away) @ each.T_gel_finger @ away)
        for name, each in pinched.others.items()
    }
    poses = {name: getattr(pinched, name) @ away for name in ("measured", "truth")}
    return dataclasses.replace(pinched, measurement=Measurement(False), ms={}, others=others, **poses)


class GraspRecord:
    """Record of the filter's belief about a grasp at each of the times [s]; an `Observer` of a trial."""

    def __init__(self, yardstick: Yardstick, times: tuple[float, ...]):
        self._yardstick, self._frames = yardstick, 0
        self._judged = [round(seconds / FRAME_TIME) for seconds in times]
        self._rows: list[dict] = []

    def __call__(self, frame: TrialFrame, estimate: Estimate, particle_filter: AnyFilter) -> None:
        self._frames += 1
        if self._frames not in self._judged:
            return
        truth, right = frame.truth, self._yardstick.right
        modes = np.array([mode.pose for mode in estimate.modes]).reshape(-1, 4, 4)
        self._rows.append(
            {
                "found": bool(right(modes, truth).any()),
                "share": float(particle_filter.weights[right(particle_filter.poses, truth)].sum()),
                "right": bool(right(estimate.pose[None], truth)[0]),
                "converged": estimate.status.state == CONVERGED,
            }
        )

    def result(self) -> dict:
        """Return `held` for the trial: at each time, whether a right mode is `found`, the `share` of the belief that is
        right, whether the published pose is `right`, and whether the state is `converged`."""
        return {"held": self._rows}
