"""What an exploration needs: made once in the present folder, and kept."""

from __future__ import annotations

from midastouch_filter.nodes.resources import resolve
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn

from ..codebooks import ensure_codebook
from ..output_paths import QUICK_POSES


def prepare(mesh: str, codebook: str) -> None:
    """Build the codebook at that path unless it is there; mesh: its path, or package://NAME/..."""
    sensor = SensorModel.load("digit_tacto")
    ensure_codebook(codebook, ObjectMesh.load(resolve(mesh, "mesh")), load_tcn("fast", sensor), sensor, QUICK_POSES)
