"""From where a run is looked at."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.mesh import ObjectMesh

from ..drawing.object_view import ObjectView
from .run import Run


@dataclasses.dataclass(frozen=True)
class Viewpoint:
    """centre (3,) m, looked at; right, up and towards_viewer (3,), unit directions in the object's frame."""

    centre: np.ndarray
    right: np.ndarray
    up: np.ndarray
    towards_viewer: np.ndarray

    @classmethod
    def of(cls, run: Run, mesh: ObjectMesh) -> Viewpoint:
        """The side of the object that the run touches, as the demo's pictures have it: by the truth, else by the
        estimates."""
        true = [m.truth for m in run.moments if m.truth is not None]
        poses = true or [e for m in run.moments for e in m.estimates if e is not None] or [np.eye(4)]
        return cls(mesh.bounds.mean(axis=0), *ObjectView(mesh, np.array(poses), 100).camera.rotation)
