"""A ball with a small run over it, for what draws runs: fixtures of several packages."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook
from midastouch_tools.bags.run_record import RecordedMode, Snapshot

RADIUS = 0.03


@pytest.fixture(scope="session")
def ball() -> ObjectMesh:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    return ObjectMesh.from_arrays(sphere.vertices, sphere.faces, "ball")


def pose_at(direction: np.ndarray) -> np.ndarray:
    normal = np.asarray(direction, float) / np.linalg.norm(direction)
    return se3.make(se3.frame_from_normal(normal[None], np.zeros(1))[0], RADIUS * normal)


@pytest.fixture(scope="session")
def run() -> list[Snapshot]:
    """12 frames over the +x side, the particles closing in."""
    rng = np.random.default_rng(0)
    snapshots = []
    for i, y in enumerate(np.linspace(-0.5, 0.5, 12)):
        truth = pose_at([1, y, 0.2])
        spread = np.array([0.02, 0.02, 0.02, 0.5, 0.5, 0.5]) / (1 + i)
        particles = truth @ se3.exp(spread * rng.standard_normal((50, 6)))
        mode = RecordedMode(1.0, particles[0], np.diag(spread**2))
        penetration = np.full((16, 12), 5e-4, np.float32)
        image = rng.integers(0, 255, (32, 24, 3), dtype=np.uint8)
        code = None if i == 3 else (truth[:3, 2] / np.linalg.norm(truth[:3, 2])).astype(np.float32)
        estimate = None if i == 0 else particles[0]
        snapshots.append(
            Snapshot(i, 0.1 * i, truth, particles, [mode], estimate, image, penetration, code, "ambiguous")
        )
    return snapshots


@pytest.fixture(scope="session")
def book(ball: ObjectMesh) -> Codebook:
    """Touches all over, whose code is their normal: what faces the same way feels the same."""
    poses = np.array([pose_at(normal) for normal in ball.sample_surface(500, np.random.default_rng(1))[1]])
    return Codebook(poses, poses[:, :3, 2], {"temperature": 0.15})
