"""Objects that come with the package, made by code for the demo and the benchmark."""

from __future__ import annotations

from pathlib import Path

from midastouch_common.errors import InputError

_FOLDER = Path(__file__).parent


def bundled_objects() -> dict[str, Path]:
    """Return mesh files by name: `handle_tool` (salient, tool-like), `ball` (symmetric), `eyebolt` (small part),
    `star_knob` (recognised at once from above)."""
    return {path.stem: path for path in sorted(_FOLDER.glob("*.ply"))}


def bundled_mesh(name: str) -> str:
    """Return the path of a bundled object's mesh.

    Parameters
    ----------
    name
        A key of `bundled_objects`.

    Returns
    -------
    str
        Path of the PLY file.

    Raises
    ------
    InputError
        There is no object of that name.
    """
    objects = bundled_objects()
    if name not in objects:
        raise InputError(f"object:={name}: not bundled; there are {', '.join(objects)}; for another give mesh:=FILE")
    return str(objects[name])
