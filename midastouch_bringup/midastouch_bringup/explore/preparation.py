"""What an exploration needs: made once in the present folder, and kept."""

from __future__ import annotations

from collections.abc import Mapping

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.nodes.object_source import resolve
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn

from ..codebooks import ensure_codebook
from ..output_paths import QUICK_POSES


def prepare(codebooks: Mapping[str, str]) -> None:
    """Build the codebooks at these paths unless they are there; of the mesh that each names, a path or package://..."""
    sensor = SensorModel.load("digit_tacto")
    tcn = load_tcn("fast", sensor)
    for codebook, mesh in codebooks.items():
        ensure_codebook(codebook, ObjectMesh.load(resolve(mesh, "mesh")), tcn, sensor, QUICK_POSES)
