"""Where in the present folder the commands put, and look for, what they make.

Imports the standard library alone: launch files, which run outside of the packages' environment, ask here.
"""

from __future__ import annotations

from pathlib import Path

SIMULATED = "digit_tacto"
"""Sensor model of codebooks for which none is named."""
QUICK_POSES = 10_000
"""Of a codebook: built within half a minute on two cores."""
CACHED_CODEBOOKS = Path("out/cache/codebooks")


def codebook_path(object_name: str, sensor: str = "") -> Path:
    """The codebook of an object, of `midastouch build-codebook`; sensor: model by name or file, "" the default one."""
    kind = Path(sensor).stem
    return Path("out/codebooks") / f"{object_name}{f'_{kind}' if kind not in ('', SIMULATED) else ''}.npz"


def demo_slide(object_name: str) -> Path:
    """The slide over an object that `midastouch run demo` and the demo's launch file play."""
    return Path("out/slides") / object_name


def cached_codebook_path(object_name: str, size: int, folder: Path = CACHED_CODEBOOKS) -> Path:
    """A codebook of `size` poses, kept by the commands that build one by the way."""
    return folder / f"{object_name}_{size}.npz"


def quick_codebook(object_name: str) -> Path:
    """The one of `QUICK_POSES` poses."""
    return cached_codebook_path(object_name, QUICK_POSES)


def exploration() -> Path:
    """Page and recording of `midastouch run explore`."""
    return Path("out/explore")
