"""Objects that come with the package, made by code for the demo and the benchmark."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent


def bundled_objects() -> dict[str, Path]:
    """Return mesh files by name: `handle_tool` (salient, tool-like), `ball` (symmetric), `eyebolt` (small part),
    `star_knob` (recognised at once from above)."""
    return {path.stem: path for path in sorted(_FOLDER.glob("*.ply"))}
