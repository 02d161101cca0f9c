"""Where in the present folder the commands put, and look for, what they make.

Imports the standard library alone: launch files, which run outside of the packages' environment, ask here.
"""

from __future__ import annotations

from pathlib import Path


def codebook_path(object_name: str) -> Path:
    """The codebook of an object, of `midastouch build-codebook`."""
    return Path("out/codebooks") / f"{object_name}.npz"


def demo_slide(object_name: str) -> Path:
    """The slide over an object that `midastouch run demo` and the demo's launch file play."""
    return Path("out/slides") / object_name
