"""Paths, below the current folder, of the files that the commands make and look for.

Imports the standard library only, because launch files use it, which run outside of the packages' environment.
"""

from __future__ import annotations

from pathlib import Path

SIMULATED = "digit_tacto"
"""Sensor model of codebooks for which none is named."""
QUICK_POSES = 10_000
"""Poses of a codebook that is built within half a minute on two cores."""
CACHED_CODEBOOKS = Path("out/cache/codebooks")


def codebook_path(object_name: str, sensor: str = "") -> Path:
    """Return the path of an object's codebook by `midastouch build-codebook`.

    Parameters
    ----------
    object_name
    sensor
        Sensor model by name or file; empty for the default.
    """
    kind = Path(sensor).stem
    return Path("out/codebooks") / f"{object_name}{f'_{kind}' if kind not in ('', SIMULATED) else ''}.npz"


def demo_slide(object_name: str) -> Path:
    """Folder of the slide over an object that `midastouch run demo` and the demo's launch file play."""
    return Path("out/slides") / object_name


def cached_codebook_path(object_name: str, size: int, folder: Path = CACHED_CODEBOOKS) -> Path:
    """Path of a codebook of `size` poses, kept by commands that build one in passing."""
    return folder / f"{object_name}_{size}.npz"


def quick_codebook(object_name: str) -> Path:
    """Path of the codebook of `QUICK_POSES` poses."""
    return cached_codebook_path(object_name, QUICK_POSES)


def exploration() -> Path:
    """Folder of the page and the recording of `midastouch run explore`."""
    return Path("out/explore")
