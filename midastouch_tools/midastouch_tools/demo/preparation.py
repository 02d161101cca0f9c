"""Preparation of the files that demo and exploration need: made once in the current folder, and kept."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import QUICK_POSES, codebook_path, demo_slide, quick_codebook
from midastouch_common.ros.addresses import load_mesh, resolve
from midastouch_perception.codebook import build_command
from midastouch_perception.objects import bundled_mesh, bundled_objects
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


def require_there(given: Mapping[str, str]) -> None:
    """Raise InputError for the first launch argument that names a file, folder or bundled object which is not there."""
    if given.get("object"):
        bundled_mesh(given["object"])
    objects = [name.strip() for name in given.get("objects", "").split(",")]
    named = [(name, given.get(name, "")) for name in ("mesh", "codebook", "background", "frames_file")]
    for name, address in [*named, *(("objects", one) for one in objects if one not in bundled_objects())]:
        if address and not resolve(address, name).exists():
            also = ""
            if address in bundled_objects():
                also = f", or give the bundled object by its name, object:={address}"
            elif name == "codebook":
                command = build_command(given.get("mesh") or "MESH", given.get("sensor_model", ""), out=address)
                also = f", or make it: {command}"
            elif name == "objects":
                also = f"; bundled are {', '.join(sorted(bundled_objects()))}"
            raise InputError(f"{name}:={address}: no such file or folder; check the path{also}")


def require_built(given: Mapping[str, str]) -> None:
    """Raise InputError if the codebook that `object` stands for is not there."""
    if given["object"] and not (given["codebook"] or given["objects"]):
        name, sensor = given["object"], given["sensor_model"]
        if not (path := codebook_path(name, sensor)).is_file():
            raise InputError(f"object:={name}: {path} is not built yet: {build_command(name, sensor)}")


def explored(given: Mapping[str, str]) -> dict[str, str]:
    """Return mesh and codebook of the object of an exploration, as given or of the bundled object; and `objects`, the
    candidates for the filter, including the object itself, empty if there is no other. As explore.launch.py does it."""
    mesh = given["mesh"] or bundled_mesh(given["object"])
    codebook = given["codebook"] or _quick(Path(mesh).stem)
    names = [name.strip() for name in given["objects"].split(",")]
    others = [name for name in names if name and name != Path(mesh).stem]
    books = [_quick(name) if name in bundled_objects() else name for name in others]
    return {"mesh": mesh, "codebook": codebook, "objects": ",".join([*books, codebook]) if books else ""}


def quick_codebooks(given: Mapping[str, str]) -> dict[str, str]:
    """Return the meshes, by codebook path, of the codebooks of an exploration that are built if they are missing."""
    what = explored(given)
    meshes = {_quick(name): str(path) for name, path in bundled_objects().items()}
    books = {path: meshes[path] for path in what["objects"].split(",") if path in meshes}
    return books if given["codebook"] else {**books, what["codebook"]: what["mesh"]}


def _quick(name: str) -> str:
    return str(quick_codebook(name).resolve())


def prepare_codebooks(codebooks: Mapping[str, str]) -> None:
    """Build the codebooks that are missing; codebooks: path of the mesh, or package://..., by path of the codebook.

    Raises InputError for a mesh that cannot be used, before the first codebook is built.
    """
    meshes = {codebook: load_mesh(mesh) for codebook, mesh in codebooks.items()}
    sensor = SensorModel.load("digit_tacto")
    tcn = load_tcn("fast", sensor)
    for codebook, mesh in meshes.items():
        ensure_codebook(codebook, mesh, tcn, sensor, QUICK_POSES)
