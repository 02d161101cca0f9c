"""Sets of objects made by code, by the name by which `--objects` asks for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from midastouch_common.mesh import ObjectMesh

from .cad_parts import CAD_PARTS
from .known_parts import write_parts
from .small_cad_parts import SMALL_CAD_PARTS
from .small_parts import small_parts

MADE: dict[str, Callable[[Path], list[ObjectMesh]]] = {
    "cad": partial(write_parts, CAD_PARTS),
    "small_parts": small_parts,
    "small_cad": partial(write_parts, SMALL_CAD_PARTS),
}
"""Each writes its meshes into a folder and returns them."""
