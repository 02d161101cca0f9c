"""Objects that are measured, by name or by set; sets made by code; and objects that a fit may use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.files import require_folder
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.objects import bundled_objects
from midastouch_simulation.training.setting import TEST_OBJECTS

from .cad_parts import CAD_PARTS, SMALL_CAD_PARTS, write_parts
from .small_parts import small_parts

_MADE: dict[str, Callable[[Path], list[ObjectMesh]]] = {
    "cad": partial(write_parts, CAD_PARTS),
    "small_parts": small_parts,
    "small_cad": partial(write_parts, SMALL_CAD_PARTS),
}
"""Sets made by code, by their name in `--objects`. Each writes its meshes into a folder and returns them."""
_MESHES = ".ply", ".stl", ".obj"
_HELD_OUT = ("008", "019", "028", "032", "033", "043", "052", "065-c", "072-b", "073-a")
"""Ten further objects for judging, on which no setting may be chosen. The networks were trained on 008, 028 and 033;
the other seven only validated them."""


def meshes_to_fit_on(folder: Path) -> list[Path]:
    """Return the mesh files of a folder that are not for judging: neither the paper's ten objects nor `_HELD_OUT`."""
    return [path for path in sorted(folder.glob("*.ply")) if not path.stem.startswith((*TEST_OBJECTS, *_HELD_OUT))]


def chosen_meshes(folder: str | None, names: Sequence[str] | None, out: str) -> list[ObjectMesh]:
    """Return the meshes asked for, by name; those of a set made by code are written under `out`. InputError for a name
    that fits none or several."""
    names = list(names or ())
    if len(names) == 1 and names[0] in _MADE:
        return _MADE[names[0]](Path(out).resolve() / "meshes")  # workers may run elsewhere
    if folder is None:
        available = bundled_objects()
        names = names or sorted(available)
    else:
        what = f"with {', '.join(_MESHES)} files"
        files = [path for path in require_folder(folder, what).iterdir() if path.suffix.lower() in _MESHES]
        if not files:
            raise InputError(f"{folder}: no mesh file in it; give a folder {what}")
        available = {path.stem: path for path in files}
        if names == ["all"]:
            return [ObjectMesh.load(path) for path in sorted(files)]
        names = list(_HELD_OUT) if names == ["held_out"] else names or list(TEST_OBJECTS)
    return [ObjectMesh.load(_one(name, available, folder or "bundled objects")) for name in names]


def _one(name: str, available: dict[str, Path], where: str) -> Path:
    fitting = [name] if name in available else sorted(one for one in available if one.startswith(name))
    if len(fitting) != 1:
        found = f"fits {', '.join(fitting)}" if fitting else f"there are {', '.join(sorted(available))}"
        raise InputError(f"{where}: no object '{name}': {found}; give its name with --objects")
    return available[fitting[0]]
