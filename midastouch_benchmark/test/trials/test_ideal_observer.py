"""The exhaustive posterior on small blocks, by rendered maps and codes that are a smooth function of the pose."""

from pathlib import Path

import numpy as np
import trimesh

from midastouch_benchmark.trials.ideal_observer import IdealObserver, observe
from midastouch_benchmark.trials.trial import TrialFrame
from midastouch_benchmark.trials.yardstick import Yardstick
from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.object_model import ObjectModel
from midastouch_filter.core.touch import Measurement
from midastouch_filter.core.workers import Workers
from midastouch_perception.codebook import Codebook, codebook_poses
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.finger import SimulatedFinger
from midastouch_perception.symmetry.group import Symmetry, about
from midastouch_perception.symmetry.search import ObjectSymmetry

CONFIG = FilterConfig(threads=1)
NOISE = NoiseModel.of(CONFIG)
SENSOR = SensorModel.load("digit_tacto")
HALF_TURNS = np.stack([np.eye(3), np.diag([1.0, -1, -1]), np.diag([-1.0, 1, -1]), np.diag([-1.0, -1, 1])])
OF_A_BOX = Symmetry(about(np.zeros(3), HALF_TURNS))
STEP = 3e-3


def block(pins: list[tuple[float, float]]) -> ObjectMesh:
    """A block with pins at the given places of its upper side."""
    parts = [trimesh.creation.box((0.044, 0.03, 0.02)).subdivide().subdivide()]
    for x, y in pins:
        parts.append(trimesh.creation.cylinder(0.004, 0.006).apply_translation((x, y, 0.011)))
    both = trimesh.util.concatenate(parts)
    loaded = ObjectMesh.from_arrays(both.vertices, both.faces, "block")
    loaded.path = Path("block.ply")
    return loaded


class World:
    """A block, what its codebook tells of its symmetry, and what is measured on it."""

    def __init__(self, mesh: ObjectMesh, symmetry: Symmetry, encode, sensor: str = "digit_tacto"):
        self.mesh, self.encode = mesh, encode
        poses = codebook_poses(mesh, 1600, SENSOR, np.random.default_rng(0))
        told = ObjectSymmetry(exact=symmetry, near=symmetry).as_json()
        meta = {"sensor": sensor, "temperature": 0.1, "outlier": 0.05, "symmetry": told}
        self.model = ObjectModel(mesh, Codebook(poses, encode(poses), meta), CONFIG, NOISE, Workers(1))
        self.yardstick = Yardstick.of(mesh, symmetry)

    def frames(self, poses: np.ndarray, seed: int = 0) -> list[TrialFrame]:
        """Touched there, as an arm with its errors reports it; maps with noise."""
        rng = np.random.default_rng(seed)
        measured = poses @ se3.exp(rng.standard_normal((len(poses), 6)) * ([2e-4] * 3 + [5e-3] * 3))
        maps = np.asarray(self.model.alignment.render(poses), np.float32)
        maps += (2e-5 * rng.standard_normal(maps.shape)).astype(np.float32)
        touches = [Measurement(True, c, 1e-4, "", m) for c, m in zip(self.encode(poses), maps, strict=True)]
        return [
            TrialFrame(k, *each, seconds=0.1)
            for k, each in enumerate(zip(touches, [{}] * len(poses), measured, poses, strict=True))
        ]

    def slide(self, headings: list[float], length: float, seed: int) -> np.ndarray:
        """Poses of a finger that slides in several directions."""
        finger = SimulatedFinger(self.mesh, SENSOR, np.random.default_rng(seed), STEP)
        list(finger.leap(0.0, 0.0))
        return np.array([finger.pose] + [pose for each in headings for pose in finger.slide(each, length)])

    def observe(self, frames: list[TrialFrame], *args, **kwargs):
        """Rows of the report, and the posteriors."""
        posteriors = []
        observer = IdealObserver(self.model, NOISE, self.yardstick, *args, **kwargs)
        return observe(observer, frames, self.yardstick, posteriors.append), posteriors
