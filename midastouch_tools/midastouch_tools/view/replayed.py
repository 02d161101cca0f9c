"""A finished run drawn moment by moment, with a slider for the time."""

from __future__ import annotations

import numpy as np

from midastouch_common.mesh import ObjectMesh

from .finished_run import Run
from .scene import Scene


def draw(run: Run, mesh: ObjectMesh, scene: Scene, recording) -> None:
    """Draw all moments of a run into a scene on a `rerun.RecordingStream`, on its timeline `moment`."""
    scene.mesh(mesh.vertices, mesh.faces, mesh.vertex_normals)
    for index, moment in enumerate(run.moments):
        recording.set_time("moment", sequence=index)
        scene.status(moment.label, run.name, {})
        scene.particles(moment.particles[:, :3, 3], np.ones(len(moment.particles)))
        covariances = np.array([mode.covariance for mode in moment.modes]).reshape(-1, 6, 6)
        poses = np.array([mode.pose for mode in moment.modes]).reshape(-1, 4, 4)
        scene.modes([mode.weight for mode in moment.modes], poses, covariances)
        for trial, pose in enumerate(moment.estimates):
            if pose is not None:
                scene.estimate(pose, f"_{trial + 1}" if trial else "")
        if moment.truth is not None:
            scene.truth(moment.truth)
        if moment.estimates[0] is not None:
            placed = moment.estimates[0]
            scene.contact((moment.contact - placed[:3, 3]) @ placed[:3, :3])
