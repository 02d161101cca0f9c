"""The objects that may be touched: of each as much as it takes to tell whether it is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_poses import YAWS
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.sensor_model import SensorModel

from .alignment import PenetrationAlignment
from .config import FilterConfig
from .localiser import LoadedObject, object_of
from .lookup import NearestEntry
from .noise_model import NoiseModel
from .touch import MAP_SCALE

FEWEST = 5_000
"""Poses of each codebook that are compared, at least."""

_SPACING = 8e-3  # m between sites: as far as an alignment reaches, `between_entries` of the noise model to either side

_SAME = 1e-6  # share of its size within which one mesh is another one


@dataclass(frozen=True)
class Entry:
    """One object: mesh; codebook, no more poses of it than `poses_worth`; path of the whole codebook, None if that is
    all; alignment to its surface."""

    mesh: ObjectMesh
    codebook: Codebook
    path: Path | None
    alignment: PenetrationAlignment

    @property
    def name(self) -> str:
        """Of the mesh."""
        return self.mesh.name

    @cached_property
    def lookup(self) -> NearestEntry:
        """Among the codebook's poses."""
        return NearestEntry(self.codebook.poses)

    def load(self, config: FilterConfig, seed: int) -> LoadedObject:
        """The filter on this object, with its whole codebook; InputError as `localiser.object_of`."""
        codebook = self.codebook if self.path is None else Codebook.load(self.path, mesh=self.mesh)
        return object_of(self.mesh, codebook, config, seed)


class Catalogue:
    """Objects of one code network and sensor.

    Attributes: entries; rows, of each entry in codes (M, D), of all; calibration of the codes; sensor, at map
    resolution; network_id; twins, for each name that stands for the same mesh as another one, that one's.
    Raises InputError: no objects, two of one name, of different networks or sensors.
    """

    def __init__(self, entries: Sequence[Entry], twins: dict[str, str] | None = None):
        if not entries:
            raise InputError("objects: none given; name codebooks, meshes or folders of codebooks")
        self.entries, self.twins = list(entries), dict(twins or {})
        first = self.entries[0].codebook.meta
        for entry in self.entries[1:]:
            _require_alike(self.entries[0], entry)
        ends = np.cumsum([0, *(len(entry.codebook.codes) for entry in self.entries)])
        self.rows = [slice(low, high) for low, high in pairwise(ends)]
        self.codes = np.concatenate([entry.codebook.codes for entry in self.entries])
        self.calibration, self.network_id = first, str(first["tcn"])
        self.sensor = SensorModel.load(first["sensor"]).for_maps

    @classmethod
    def of(cls, objects: Sequence[tuple[ObjectMesh, Codebook, Path | None]], noise: NoiseModel) -> Catalogue:
        """Of meshes with their codebooks, and the files of these if `Entry.load` is to read them again.

        Meshes that are the same count once, under the first one's name.
        """
        entries: list[Entry] = []
        twins: dict[str, str] = {}
        for mesh, codebook, path in objects:
            twin = next((entry.name for entry in entries if _are_same(entry.mesh, mesh)), None)
            if twin is not None:
                twins[mesh.name] = twin
            elif mesh.name in (entry.name for entry in entries):
                raise InputError(f"{mesh.path or mesh.name}: another object is called '{mesh.name}'; rename the file")
            else:
                entries.append(_entry(mesh, codebook, path, noise))
        return cls(entries, twins)

    def __len__(self) -> int:
        return len(self.entries)

    def number(self, name: str) -> int:
        """Of the object of that name."""
        return [entry.name for entry in self.entries].index(name)

    def without(self, name: str) -> Catalogue:
        """The same but for one object."""
        return Catalogue([entry for entry in self.entries if entry.name != name])


def poses_worth(mesh: ObjectMesh) -> int:
    """Poses that it takes to tell whether this object is touched: sites at an even distance, whatever its size."""
    return max(FEWEST, YAWS * math.ceil(mesh.area / _SPACING**2))


def read_catalogue(
    sources: Sequence[Path], build: Callable[[Path], tuple[ObjectMesh, Codebook]], noise: NoiseModel
) -> Catalogue:
    """From codebooks (.npz), whose meshes they name, folders of codebooks, and meshes.

    build: makes the codebook of a mesh. Of a codebook only what is needed is read. Raises InputError that names the
    file: missing, unreadable, too large or too small, and as `Catalogue`.
    """
    return Catalogue.of([each for source in _files(sources) for each in [_read(source, build)]], noise)


def _files(sources: Sequence[Path]) -> list[Path]:
    out: list[Path] = []
    for source in sources:
        if source.is_dir():
            inside = sorted(source.glob("*.npz"))
            if not inside:
                raise InputError(f"{source}: folder without codebooks (*.npz); fill it with midastouch build-codebook")
            out += inside
        else:
            out.append(source)
    return out


def _read(
    source: Path, build: Callable[[Path], tuple[ObjectMesh, Codebook]]
) -> tuple[ObjectMesh, Codebook, Path | None]:
    if source.suffix != ".npz":
        return (*build(source), None)
    meta = Codebook.load(source, first=1).meta
    mesh_path = Path(meta.get("mesh_path") or "")
    if not mesh_path.is_file():
        raise InputError(f"{source}: its mesh '{mesh_path}' is not there any more; build the codebook again")
    mesh = ObjectMesh.load(mesh_path)
    if mesh.sha256 != meta["mesh_sha256"]:
        raise InputError(f"{source}: its mesh {mesh_path} has changed since; build the codebook again")
    return mesh, Codebook.load(source, mesh=mesh, first=poses_worth(mesh)), source


def _entry(mesh: ObjectMesh, codebook: Codebook, path: Path | None, noise: NoiseModel) -> Entry:
    if missing := [name for name in ("sensor", "tcn") if not codebook.meta.get(name)]:
        raise InputError(f"{path or mesh.name}: codebook that does not say its {', '.join(missing)}; build it again")
    if path is not None and len(codebook.poses) > (worth := poses_worth(mesh)):
        codebook = Codebook(codebook.poses[:worth], codebook.codes[:worth], codebook.meta)
    sensor = SensorModel.load(codebook.meta["sensor"]).scaled(MAP_SCALE)
    return Entry(mesh, codebook, path, PenetrationAlignment(mesh, sensor, noise))


def _are_same(a: ObjectMesh, b: ObjectMesh) -> bool:
    """Whether two meshes are one, be it in other files."""
    close = _SAME * a.diagonal
    return a.sha256 == b.sha256 or (
        a.faces.shape == b.faces.shape
        and np.allclose(a.bounds, b.bounds, rtol=0, atol=close)
        and np.isclose(a.area, b.area, rtol=_SAME)
    )


def _require_alike(first: Entry, other: Entry) -> None:
    """Raise InputError unless codes of both can be compared."""
    for key, what in (("tcn", "network"), ("sensor", "sensor")):
        one, two = first.codebook.meta[key], other.codebook.meta[key]
        if one != two:
            raise InputError(
                f"{other.path or other.name}: codebook of the {what} {two}, that of {first.name} is of {one}; "
                "build one of them again"
            )
