"""Preparation of the files that demo and exploration need: made once in the current folder, and kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import QUICK_POSES, codebook_path, demo_slide
from midastouch_common.ros.addresses import load_mesh, resolve
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import load_tcn

from ..codebooks import ensure_codebook
from ..datasets.slide_simulation import simulate_sequence
from . import SEED, SLIDE_LENGTH

CODEBOOK_SIZE = 50_000  # the default of `midastouch build-codebook`


def prepare_slide(object_name: str, mesh_path: str | Path) -> None:
    """Simulate the slide and build the codebook of an object, unless they exist."""
    mesh, sensor = ObjectMesh.load(mesh_path), SensorModel.load("digit_tacto")
    slide = demo_slide(object_name)
    if not slide.is_dir():
        simulate_sequence(mesh, sensor, SLIDE_LENGTH, SEED, slide, progress=True)
    ensure_codebook(codebook_path(object_name), mesh, load_tcn("fast", sensor), sensor, CODEBOOK_SIZE)


def require_there(named: Iterable[tuple[str, str]]) -> None:
    """Raise InputError for the first argument (name, address) with nothing at its address."""
    for name, address in named:
        if not resolve(address, name).exists():
            raise InputError(f"{name}:={address}: no such file or folder; check the path")


def prepare_codebooks(codebooks: Mapping[str, str]) -> None:
    """Build the codebooks that are missing; codebooks: path of the mesh, or package://..., by path of the codebook.

    Raises InputError for a mesh that cannot be used, before the first codebook is built.
    """
    meshes = {codebook: load_mesh(mesh) for codebook, mesh in codebooks.items()}
    sensor = SensorModel.load("digit_tacto")
    tcn = load_tcn("fast", sensor)
    for codebook, mesh in meshes.items():
        ensure_codebook(codebook, mesh, tcn, sensor, QUICK_POSES)
