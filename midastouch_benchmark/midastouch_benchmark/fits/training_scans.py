"""Choice of scans and slides, for all fits on slides across training scans.

The scans include neither the paper's ten objects nor the ten that were held out for judging.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from midastouch_benchmark.trials.cache import Cache, SlideKind
from midastouch_common.mesh import ObjectMesh

from ..trials.object_sets import meshes_to_fit_on

LENGTH = 0.3  # m of a slide


def parser_of(
    description: str, out: str, every: int, poses: int, meshes_required: bool = True
) -> argparse.ArgumentParser:
    """Return a parser of the options of `cache_of` and `scans_of`, and of the number of slides over each scan."""
    parser = argparse.ArgumentParser(description=description.partition("\n")[0])
    parser.add_argument("--meshes", type=Path, required=meshes_required)
    parser.add_argument("--out", type=Path, default=Path(out))
    parser.add_argument("--slides", type=int, default=2, help="over each scan")
    parser.add_argument("--every", type=int, default=every, help="n-th training scan is taken")
    parser.add_argument("--poses", type=int, default=poses, help="of each codebook")
    return parser


def cache_of(args: argparse.Namespace, length: float = LENGTH) -> Cache:
    """Return a cache of slides of this length [m] and of codebooks, in the folder of the fit."""
    return Cache(args.out, slides=SlideKind(length), codebook_size=args.poses)


def scans_of(args: argparse.Namespace) -> Iterator[ObjectMesh]:
    """Return the training scans asked for; none without a folder of them."""
    return map(ObjectMesh.load, meshes_to_fit_on(args.meshes)[:: args.every] if args.meshes else ())
