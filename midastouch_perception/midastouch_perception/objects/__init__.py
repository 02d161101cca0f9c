"""The objects that come with the package, for the demo and the benchmark: procedural, of our own making."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent


def bundled_objects() -> dict[str, Path]:
    """Name -> mesh file: `handle_tool` (salient, tool-like), `ball` (symmetric), `eyebolt` (small part), `star_knob`
    (told at once from above)."""
    return {path.stem: path for path in sorted(_FOLDER.glob("*.ply"))}
