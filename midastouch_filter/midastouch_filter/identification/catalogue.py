"""Catalogue of the objects that may be touched, with a model of each to identify it by."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import YAWS, Codebook, mapped_npz, require_sensor
from midastouch_perception.sensor_model import SensorModel

from ..core.config import FilterConfig
from ..core.noise_model import NoiseModel
from ..core.object_model import ObjectModel, of_surface
from ..core.workers import Workers
from ..loaded_object import SIZE

FEWEST = SIZE
"""Fewest poses of each codebook that are compared: as many as are enough to localise by."""

ROOM = 2**20
"""Most poses of a catalogue; a touch is compared with all: 40 ms of one core, a third more than all YCB scans."""

_SPACING = 8e-3  # m between sites: an alignment reaches `between_entries` of the noise model to either side

_SAME_SIZE = 8 * np.finfo(np.float32).eps  # fraction of the size by which a mesh that is written again may differ


class Entry:
    """One object of a catalogue.

    Attributes: name; mesh; meta, description of its codebook; source, the codebook's file, or the mesh's; model, made
    in advance, so that no touch has to wait for it.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        codebook: Codebook,
        path: Path | None,
        config: FilterConfig,
        noise: NoiseModel,
        workers: Workers,
    ):
        self.name, self.mesh, self.meta = mesh.name, mesh, codebook.meta
        self.source = path or mesh.path or mesh.name
        if missing := [name for name in ("sensor", "tcn") if not codebook.meta.get(name)]:
            raise InputError(f"{self.source}: codebook without its {', '.join(missing)}; build it again")
        self.model = ObjectModel(mesh, codebook, config, noise, workers)

    def is_same_as(self, other: Entry) -> bool:
        """Return whether the two meshes are the same, even if in different files."""
        close = _SAME_SIZE * self.mesh.diagonal
        return self.mesh.sha256 == other.mesh.sha256 or (
            self.mesh.faces.shape == other.mesh.faces.shape
            and np.allclose(self.mesh.bounds, other.mesh.bounds, rtol=0, atol=close)
            and bool(np.isclose(self.mesh.area, other.mesh.area, rtol=_SAME_SIZE))
        )


class Catalogue:
    """Objects of one code network and sensor.

    Attributes: entries; duplicates; sensor, at map resolution; network_id.

    Parameters
    ----------
    entries
    duplicates
        Name of the entry with the same mesh, for each name that was left out.

    Raises
    ------
    InputError
        There are no objects.
    """

    def __init__(self, entries: Sequence[Entry], duplicates: dict[str, str] | None = None):
        if not entries:
            raise InputError("objects: none given; name codebooks, meshes or folders of codebooks")
        self.entries, self.duplicates = list(entries), dict(duplicates or {})
        first = self.entries[0].meta
        self.sensor, self.network_id = SensorModel.of_codebook(first).for_maps, str(first["tcn"])

    @classmethod
    def of(
        cls, objects: Iterable[tuple[ObjectMesh, Codebook, Path | None]], config: FilterConfig, room: int = ROOM
    ) -> Catalogue:
        """Make a catalogue; equal meshes count once, under the name of the first.

        Parameters
        ----------
        objects
            Meshes and codebooks, and the codebooks' files, if there are any, to name in messages.
        config
        room
            Largest number of poses.

        Raises
        ------
        InputError
            There are more poses, two objects of one name, or codebooks of different networks or sensors.
        """
        noise, workers = NoiseModel.of(config), Workers(config.threads)
        entries: list[Entry] = []
        duplicates: dict[str, str] = {}
        poses = 0
        for mesh, codebook, path in objects:
            entry = Entry(mesh, codebook, path, config, noise, workers)
            if entries:
                _require_alike(entries[0], entry)
            original = next((each.name for each in entries if each.is_same_as(entry)), None)
            if original is not None:
                duplicates[mesh.name] = original
                continue
            if mesh.name in (each.name for each in entries):
                raise InputError(f"{mesh.path or mesh.name}: another object is called '{mesh.name}'; rename the file")
            entries.append(entry)
            poses += len(entry.model.lookup)
            if poses > room:
                raise InputError(
                    f"{entry.source}: the {len(entries)} objects up to this one have {poses:,} poses to compare a "
                    f"touch with, {room:,} are allowed; leave objects out of the catalogue"
                )
        return cls(entries, duplicates)

    def __len__(self) -> int:
        return len(self.entries)

    def entry(self, name: str) -> Entry:
        """Return the object of that name."""
        return next(entry for entry in self.entries if entry.name == name)

    def without(self, name: str) -> Catalogue:
        """Return the catalogue without one object."""
        return Catalogue([entry for entry in self.entries if entry.name != name])


def poses_worth(mesh: ObjectMesh) -> int:
    """Return the number of poses that identify this object: sites are equally far apart, whatever its size."""
    return max(FEWEST, YAWS * math.ceil(mesh.area / _SPACING**2))


def read_catalogue(
    sources: Sequence[Path],
    build: Callable[[Path], tuple[ObjectMesh, Codebook]],
    config: FilterConfig,
    sensor: str | Path,
    room: int = ROOM,
) -> Catalogue:
    """Read the objects of a catalogue; only the needed part of each codebook is read.

    Parameters
    ----------
    sources
        Codebooks (.npz), which name their meshes; folders of codebooks, of which those of other sensors are left out;
        meshes.
    build
        Makes the codebook of a mesh file.
    config
    sensor
        As for `SensorModel.load`.
    room : largest number of poses of all objects

    Returns
    -------
    Catalogue
        The objects; equal meshes count once.

    Raises
    ------
    InputError
        A file, which is named, is missing, unreadable, too large or too small, or of another sensor; or as
        `Catalogue.of`.
    """
    catalogue = Catalogue.of((_read(source, build) for source in _files(sources, sensor)), config, room)
    require_sensor(catalogue.sensor, sensor, catalogue.entries[0].source)
    return catalogue


def _files(sources: Sequence[Path], sensor: str | Path) -> list[Path]:
    out: list[Path] = []
    ours = SensorModel.load(sensor).for_maps.content_id
    for source in sources:
        if not source.is_dir():
            out.append(source)
            continue
        inside = sorted(source.glob("*.npz"))
        if not inside:
            raise InputError(f"{source}: folder without codebooks (*.npz); fill it with midastouch build-codebook")
        # a folder may hold an object's codebooks for several sensors
        sensors = (SensorModel.of_codebook(Codebook.load(path, first=1).meta).for_maps for path in inside)
        out += [path for path, model in zip(inside, sensors, strict=True) if model.content_id == ours] or inside[:1]
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
    codebook = Codebook.load(source, mesh=mesh, first=poses_worth(mesh))
    codebook.derived = of_surface(mapped_npz(source))
    return mesh, codebook, source


def _require_alike(first: Entry, other: Entry) -> None:
    """Raise InputError unless the codes of both can be compared."""
    for key, what in (("tcn", "network"), ("sensor", "sensor")):
        one, two = first.meta[key], other.meta[key]
        if one != two:
            raise InputError(
                f"{other.source}: codebook of the {what} {two}, that of {first.name} is of {one}; "
                "build one of them again"
            )
    if SensorModel.of_codebook(first.meta).content_id != SensorModel.of_codebook(other.meta).content_id:
        raise InputError(
            f"{other.source}: codebook of a sensor {other.meta['sensor']} with another geometry than "
            f"that of {first.name}; build one of them again"
        )
