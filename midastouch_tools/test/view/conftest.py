"""A run made up: particles that gather, one mode, a contact, the truth, on a box."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
import trimesh

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_tools.bags.run_record import RecordedMode
from midastouch_tools.view import require_open3d
from midastouch_tools.view.finished_run import Moment, Run

MOMENTS = 4


@pytest.fixture
def mesh() -> ObjectMesh:
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    return ObjectMesh.from_arrays(box.vertices, box.faces, "box")


@pytest.fixture
def run() -> Run:
    """The gel slides along x over the box's upper side, z = 20 mm; no pose is published at the first moment."""
    rng = np.random.default_rng(0)
    moments = []
    for i in range(MOMENTS):
        truth = se3.translation([0.002 * i, 0, 0.02])
        particles = truth @ se3.exp(rng.normal(0, 1e-3, (50, 6)))
        covariance = np.diag([1e-3, 2e-3, 3e-3, 0.1, 0.1, 0.1]) ** 2
        contact = truth[:3, 3] + rng.uniform(-2e-3, 2e-3, (20, 3))
        estimate = truth if i else None
        moments.append(
            Moment(
                f"{i} s",
                particles,
                [RecordedMode(0.7, truth, covariance)],
                [estimate],
                truth,
                contact if i else contact[:0],
            )
        )
    return Run("made up", "box", moments)


POSES = [[0.01 * i, 0, 0.02, 0, 0, 0, 1] for i in range(3)]


def evaluation(*names: str, mesh: str = "box.ply") -> dict:
    """The parts of a result of evaluate that are read: of each sequence two trials, the second without a first pose."""
    trials = [
        {
            "sequence": name,
            "per_frame": {
                "frame": [0, 5, 10],
                "estimate": [None if seed else POSES[0], POSES[1], POSES[2]],
                "state": ["lost", "ambiguous" if seed else "converged", "converged"],
            },
        }
        for name in names
        for seed in range(2)
    ]
    return {"sequences": [{"sequence": n, "mesh": mesh, "truth": POSES} for n in names], "trials": trials}


@pytest.fixture
def open3d():
    if importlib.util.find_spec("open3d") is None:
        pytest.skip("the open3d extra is not installed")
    return require_open3d()
