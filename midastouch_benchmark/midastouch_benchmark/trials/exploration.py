"""Closed loop: a simulated finger, or that of an arm in MuJoCo, explores until the filter is converged.

It goes where the filter suggests or at random. It decides as the node `explorer` does, by the same code.
"""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np

import midastouch_motion
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_errors
from midastouch_filter.active_touch.suggestion import Advice, Wanted
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.estimate import Estimate
from midastouch_filter.core.state import CONVERGED, UNINITIALISED
from midastouch_filter.core.touch import measurement_of
from midastouch_filter.identification.catalogue_localiser import CatalogueLocaliser
from midastouch_filter.identification.identity import UNKNOWN
from midastouch_filter.loaded_object import object_of
from midastouch_filter.localiser import Localiser
from midastouch_motion.exploration.acts import Plan
from midastouch_motion.exploration.exploration import Exploration
from midastouch_motion.exploration.reach import EVERYWHERE
from midastouch_motion.exploration.surroundings import Surroundings
from midastouch_perception.pipeline import TouchReading
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.camera import TactoCamera
from midastouch_simulation.mujoco_arm import require_mujoco
from midastouch_simulation.slide import STEP, measure_poses
from midastouch_simulation.world import World
from midastouch_tools.datasets.slide_simulation import NOISE_R, NOISE_T

from ..evidence import fingerprint
from .cache import Cache
from .identification import books_of, catalogue_of, right_answer
from .trial import FRAME_TIME
from .trial_log import Campaign, source_digest
from .yardstick import Yardstick

POLICIES = {
    "suggested": "where `suggest_motion` says, which is asked for slides only",
    "lifts": "the same, asked for lifts, too",
    "random": "slides and lifts in random directions",
    "arm": "of an arm in MuJoCo, where `suggest_motion` says, which is asked for lifts, too",
    "arm_catalogue": "the same; which of all objects it is, is not known",
    "arm_stranger": "the same; the object is none of the known ones, and to say so is right",
}
_BY_DEFAULT = "suggested", "lifts", "random"  # those that need no further package
_OF_A_CATALOGUE = {"arm_catalogue", "arm_stranger"}
_CONVERGED_PATH = 0.015  # m, over which `converged` must last
_OPEN, _KNOWN, _FOREIGN = "given up", "converged", "another object"  # endings


@dataclasses.dataclass(frozen=True)
class ExplorationPlan(Campaign):
    """Settings of a run. cache: of codebooks and symmetries; config: of the filter; policies: of `POLICIES`; trials:
    per object and policy, with seeds from 0; length [m]: after which a trial is given up; catalogue: mesh files of all
    objects."""

    cache: Cache
    config: FilterConfig
    policies: tuple[str, ...]
    trials: int
    length: float
    catalogue: tuple[Path, ...]
    LOG_NAME = "exploration.jsonl"

    def describe(self) -> dict:
        """Return the settings for the JSON."""
        return {
            "policies": {name: POLICIES[name] for name in self.policies},
            "trials": self.trials,
            "length_m": self.length,
            "step_m": STEP,
            "codebook_size": self.cache.codebook_size,
            "networks": self.cache.describe(),
            "filter": dataclasses.asdict(self.config),
            "code": source_digest(Path(midastouch_motion.__file__).parent, Path(__file__)),
            "fingerprint": fingerprint.of_estimates(),
        }

    def rounds(self) -> list[list[dict]]:
        """Return the labels by seed; with one seed, all policies begin at one place."""
        return [[{"policy": policy, "seed": seed} for policy in self.policies] for seed in range(self.trials)]

    def depends_on(self, mesh: ObjectMesh) -> dict:
        """Return everything on which a trial depends, except its labels."""
        out = self.describe() | {"policies": None, "trials": None, "codebook": self.cache.codebook_digest(mesh)}
        needed = not _OF_A_CATALOGUE.isdisjoint(self.policies)
        return out | {"catalogue": books_of(self.cache, self.catalogue)} if needed else out

    def trial(self, mesh: ObjectMesh, labels: dict) -> dict:
        """Explore with one policy from one place."""
        return _Trial(self, mesh, labels["policy"], labels["seed"]).run()


def chosen_policies(names: list[str] | None) -> tuple[str, ...]:
    """Return policies by name, by default those without an arm; InputError if one is unknown, or lacks MuJoCo."""
    for name in names or ():
        if name not in POLICIES:
            raise InputError(f"--policy {name}: not known; there are {', '.join(POLICIES)}")
    if any(name.startswith("arm") for name in names or ()):
        require_mujoco()
    return tuple(dict.fromkeys(names or _BY_DEFAULT))


class _Trial:
    """Exploration of one object by one finger, until its pose is known."""

    def __init__(self, plan: ExplorationPlan, mesh: ObjectMesh, policy: str, seed: int):
        cache, networks = plan.cache, plan.cache.networks
        self._localiser: Localiser = Localiser(None, wait=False)
        self._meshes, self._truth = {mesh.name: mesh}, mesh.name  # of the possible objects; which it is
        if policy in _OF_A_CATALOGUE:
            catalogue = catalogue_of(cache, plan.catalogue, plan.config)
            if policy == "arm_stranger":
                catalogue = catalogue.without(catalogue.duplicates.get(mesh.name, mesh.name))
            self._localiser = CatalogueLocaliser(catalogue, plan.config, seed)
            self._meshes = {entry.name: entry.mesh for entry in catalogue.entries}
            self._truth = right_answer(catalogue, mesh.name)
        else:
            self._localiser.set_object(object_of(mesh, cache.codebook(mesh), plan.config, seed))
        self._rng = np.random.default_rng(seed)
        self._camera = TactoCamera(networks.sensor, self._rng)
        self._renderer = PenetrationRenderer(mesh, networks.sensor)
        self._pipeline, self._yardstick = networks.pipeline(), Yardstick.of(mesh, cache.symmetry(mesh).exact)
        self._arm = None
        if policy.startswith("arm"):
            from .arm_world import ArmWorld  # it needs ROS for its settings, and other fingers do not

            self._arm = ArmWorld(mesh, networks.sensor, self._perceive, self._rng)
        self._world = self._arm or World(mesh, networks.sensor, self._rng, STEP)
        reach = self._arm.reach if self._arm else EVERYWHERE
        self._exploration = Exploration(np.random.default_rng([seed, 1]), plan.length, reach, size=mesh.diagonal)
        self._policy, self._length = policy, plan.length
        self._stamp, self._path = 0, 0.0
        self._before: np.ndarray | None = None
        self._converged_at: float | None = None
        self._alike = 0
        self._asked_ms: list[float] = []
        self.estimate: Estimate | None = None

    def run(self) -> dict:
        """Explore, and return the result.

        ending: "converged", "alike" (the advice was that nothing tells the hypotheses apart), "another object" (than
        the known ones) or "given up"; path_m: from the first touch to where that began; error_mm: of the last pose,
        modulo symmetry; right: whether object and pose are, or it is another object and the ending says so; asked_ms:
        median and longest CPU time of an answer. With an arm, its explorer decides when the pose is known, and only the
        path in contact counts; seconds: simulated, until then; deepest_mm: of the object in the gel, along its axis;
        indented_mm: of the shortest ways off the object, the longest.
        """
        ending, began = self._follow(self._exploration.touch())
        while self._path < self._length and ending == _OPEN and self._exploration.verdict is None:
            state = UNINITIALISED if self.estimate is None else self.estimate.status.state
            _, plan = self._exploration.decide(self._advice(), self._around(), state)
            ending, began = self._follow(plan)
        began = self._length if ending == _OPEN else began
        return {
            "ending": ending,
            "path_m": float(began),
            "asked_ms": [float(np.median(self._asked_ms)), max(self._asked_ms)] if self._asked_ms else None,
            "seconds": self._arm.rig.rehearsal.now if self._arm else None,
            "deepest_mm": 1e3 * self._arm.deepest if self._arm else None,
            "indented_mm": 1e3 * self._arm.indented if self._arm else None,
            **self._answer(ending),
        }

    def _answer(self, ending: str) -> dict:
        """Return the error of the last estimate, and whether the answer is right; None without an estimate on it."""
        if self._truth == UNKNOWN or self.estimate is None or self._localiser.object.name != self._truth:
            return {"error_mm": None, "right": ending == _FOREIGN and self._truth == UNKNOWN}
        truth, pose = self._before, self.estimate.pose[None]
        return {
            "error_mm": 1e3 * float(pose_errors(self._yardstick.counted(pose, truth), truth)[0][0]),
            "right": bool(self._yardstick.right(pose, truth)[0]),
        }

    def _advice(self) -> Advice | None:
        """Ask where to touch next, if the policy does; as `explorer` does, only while the finger touches something."""
        if self._policy == "random" or self.estimate is None or not self._exploration.motions.touching:
            return None
        began = time.process_time()
        advice = self._localiser.advise(Wanted(lifts=self._policy != "suggested"))
        self._asked_ms.append(1e3 * (time.process_time() - began))
        self._alike = self._alike + 1 if advice.indistinguishable else 0
        return advice

    def _around(self) -> Surroundings:
        """Return the surroundings of the gel according to the best mode."""
        gel = self._world.base_from_gel
        if self.estimate is None:
            return Surroundings(gel)
        return Surroundings(gel, gel @ se3.inverse(self.estimate.pose), self._meshes[self._localiser.object.name])

    def _follow(self, plan: Plan[None]) -> tuple[str, float]:
        """Carry out a plan, at most until the trial's end; return the ending and the path [m] to it."""
        for pose in self._world.follow(plan):
            self._frame(pose)
            lasts = self._converged_at is not None and self._path - self._converged_at >= _CONVERGED_PATH
            if self._arm is None and lasts:
                return _KNOWN, self._converged_at
        if self._arm is not None:
            self._judge()
        verdict = self._exploration.verdict
        if verdict is not None and (verdict.known or verdict.foreign):
            return (_KNOWN if verdict.known else _FOREIGN), self._path
        return ("alike" if self._alike >= 2 else _OPEN), self._path

    def _judge(self) -> None:
        """Judge the filter's answer after a motion, as the node `explorer` does."""
        state, why = UNINITIALISED, self._localiser.waiting_for
        if self.estimate is not None:
            state, why = self.estimate.status.state, self.estimate.status.reason
        self._exploration.judge(state, why, measured=True, unknown=self._localiser.unknown)

    def _perceive(self, pose: np.ndarray) -> TouchReading:
        """Return the touch that an image at a pose (4, 4) shows."""
        penetration, normals = self._renderer.render_with_normals(pose[None])
        image = self._camera.image(penetration[0], normals[0], self._rng)
        return self._pipeline.process(image, self._camera.background)

    def _frame(self, pose: np.ndarray) -> None:
        """Process one image at a pose (4, 4)."""
        if self._arm:
            touch, measured = self._arm.sensed
        else:
            touch, measured = self._perceive(pose), measure_poses(pose[None], self._rng, NOISE_T, NOISE_R)[0]
        measurement = measurement_of(touch)
        if self._before is None and not measurement.in_contact:
            return
        if self._before is not None and (self._arm is None or measurement.in_contact):
            self._path += float(np.linalg.norm(pose[:3, 3] - self._before[:3, 3]))
        self._before = pose
        self._stamp += round(1e9 * (self._arm.rig.frame_time if self._arm else FRAME_TIME))
        self.estimate = self._localiser.process(measured, measurement, stamp=self._stamp)
        if self.estimate is None or self.estimate.status.state != CONVERGED:
            self._converged_at = None
        elif self._converged_at is None:
            self._converged_at = self._path
