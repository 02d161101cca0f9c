"""Tactile codebook of one object: sensor poses and the code expected at each (paper section 4.2).

The poses are spread evenly over the reachable surface and evenly in yaw, with more of them on edges.
"""

from __future__ import annotations

import json
import shlex
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

import midastouch_kernels as kernels
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, readable, require_file
from midastouch_common.mesh import ObjectMesh

from .arrays import read_npz
from .rendering.contact_poses import MAX_EXCESS, Reachability, pose_from_contact, touch_points
from .sensor_model import SensorModel, given_as
from .symmetry.search import ObjectSymmetry

FORMAT = 1
PRESS = 1e-3  # m, penetration of every entry; the codes are trained to match touches of any penetration with it
YAWS = 16  # entries per site; 22.5 deg turn the rim of the contact by about as much as sites are apart
_MOST_SURPLUS = 12.0  # ratio of sites tried to sites wanted; if even that is too few, the mesh is at fault
_SETTLED_AT_ONCE = 512  # poses; ten seconds of work for a fine mesh that lies under the gel as a whole
_TRIED, _HARDLY = 4096, 0.01  # the search ends if, after so many poses, less than that fraction is reachable
_NORMAL_SCALE = 0.01  # m: two normals 1 rad apart count as far apart as two points 10 mm apart (the paper's alpha)
_CONTENT = ("poses", "codes", "meta", "checksum")
_ROUNDED = 0.01  # by which the length of a code may differ from 1: it is kept in 16 bits
_OUTSIDE = 5e-3  # m that an entry's touched point may lie outside the mesh's bounds; a gel over a gap makes it 2 mm
_DESCRIPTION = ("mesh_name", "mesh_sha256", "sensor", "sensor_id", "tcn")
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_LENGTHS = 26  # offset in a member's local header of the lengths of its name and its extra field (ZIP, 4.3.7)


def build_command(mesh: str | Path, sensor: str | Path = "", tcn: str = "", out: str | Path = "") -> str:
    """Return a command, ready to paste, that builds a codebook.

    Parameters
    ----------
    mesh
    sensor, tcn, out
        Options of the command; empty ones have their defaults.
    """
    options = {"--sensor": sensor, "--tcn": tcn, "--out": out}
    words = [word for option, given in options.items() if given for word in (option, str(given))]
    return shlex.join(["midastouch", "build-codebook", str(mesh), *words])


def require_sensor(theirs: SensorModel, wanted: str | Path, source: str | Path) -> None:
    """Require that a codebook is of a kind of sensor: otherwise all contacts would differ in size.

    Parameters
    ----------
    theirs
        The codebook's model, at map resolution.
    wanted
        The model in use, as for `SensorModel.load`.
    source
        The codebook's file, for the message.

    Raises
    ------
    InputError
        It is of another kind.
    """
    if theirs.content_id != SensorModel.load(wanted).for_maps.content_id:
        raise InputError(
            f"{source}: codebook of the sensor model {theirs.name}, but {wanted} is used; build it with "
            f"{build_command('MESH', wanted)}, or use the sensor model {given_as(theirs.name)}"
        )


def codebook_poses(
    mesh: ObjectMesh,
    size: int,
    sensor: SensorModel,
    rng: np.random.Generator,
    pause: Callable[[], None] = lambda: None,
    searched: Callable[[int], None] = lambda found: None,
) -> np.ndarray:
    """Return exactly `size` reachable gel poses T_obj_gel (size, 4, 4) (paper section 4.2, "evenly sample").

    Sites are a farthest-point sequence over (point, normal). So both sides of a thin plate count as apart; edges, where
    the normal turns, get more sites; and the first sites, any number of them, also cover the surface evenly.
    `pause` is called now and then; an exception from it ends the work. `searched` gets the number of poses found so
    far, which starts at 0 again when the search is repeated with more sites. Raises InputError if too few poses of the
    object are reachable.
    """
    if size < 1:
        raise InputError(f"codebook size {size}; it needs at least 1 pose, 50000 is usual")
    yaws = min(YAWS, size)
    wanted = -(-size // yaws)
    reachability = Reachability(mesh, sensor)
    surplus, fraction = 2.0, 1.0
    while surplus <= _MOST_SURPLUS:
        points, normals = _candidates(mesh, max(round(6 * surplus * wanted), 512), rng)
        features = np.hstack([points, _NORMAL_SCALE * normals])
        sites = kernels.farthest_points(features, round(surplus * wanted))
        n = len(sites)
        yaw = (rng.random((n, 1)) + np.arange(yaws)) * (2 * np.pi / yaws)
        poses = pose_from_contact(
            np.repeat(points[sites], yaws, axis=0), np.repeat(normals[sites], yaws, axis=0),
            yaw.reshape(-1), np.zeros(n * yaws), np.zeros(n * yaws), np.full(n * yaws, PRESS),
        )  # fmt: skip
        reachable, fraction = _reachable(reachability, poses, size, pause, searched)
        if len(reachable) == size:
            return reachable
        # as many as this fraction requires, and some more
        surplus = 1.2 * max(surplus, 1 / max(fraction, 1e-3))
    raise InputError(
        f"{mesh.path or mesh.name}: the gel reaches only {fraction:.1%} of the poses that were tried; at the others it "
        f"touches nothing or sinks in more than {1e3 * (PRESS + MAX_EXCESS):.0f} mm; close gaps that are narrower than "
        "the gel, as those between fine teeth, and check that the mesh is in metres and not inside out"
    )


def _reachable(
    reachability: Reachability, poses: np.ndarray, size: int, pause: Callable[[], None], searched: Callable[[int], None]
) -> tuple[np.ndarray, float]:
    """Return the first `size` reachable ones of the poses (N, 4, 4), settled, or fewer, and the reachable fraction of
    those tried. Works in pieces, because each pose is rendered."""
    found, count, tried = [], 0, 0
    while tried < len(poses) and count < size and (tried < _TRIED or count >= _HARDLY * tried):
        pause()
        piece = poses[tried : tried + _SETTLED_AT_ONCE]
        settled, reachable = reachability.settle(piece, np.full(len(piece), PRESS))
        found.append(settled[reachable])
        count, tried = count + len(found[-1]), tried + len(piece)
        searched(min(count, size))
    return np.concatenate(found)[:size], count / tried


def _candidates(mesh: ObjectMesh, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return surface points with face, edge or smoothed normals: near an edge a finger can lie along any of these."""
    points, normals = touch_points(mesh, n, edge_fraction=0.25, rng=rng)
    smooth = rng.random(n) < 0.4
    normals[smooth] = mesh.smooth_normals(points[smooth])
    return points, normals


class Codebook:
    """Poses with their codes.

    The attribute `meta` holds format, mesh_name, mesh_sha256, mesh_path, sensor, sensor_id, sensor_model (its
    geometry), tcn (network id), temperature, outlier (calibration of the score), size, seed, symmetry
    (`ObjectSymmetry.as_json`).

    Parameters
    ----------
    poses : `T_obj_gel` (M, 4, 4)
    codes : (M, D), of length 1
    meta
    derived
        Arrays by name that users of the codebook have computed from poses and mesh, kept to save time.
    source
        The file, for messages.
    """

    def __init__(
        self,
        poses: np.ndarray,
        codes: np.ndarray,
        meta: dict,
        derived: dict[str, np.ndarray] | None = None,
        source: str = "codebook",
    ):
        self.poses = np.ascontiguousarray(poses, float)
        self.codes = np.ascontiguousarray(codes, np.float32)
        self.meta, self.source = meta, source
        self.derived = derived or {}

    @cached_property
    def symmetry(self) -> ObjectSymmetry | None:
        """Symmetry of the object; None if the codebook holds none or an outdated one. Raises InputError if broken."""
        if "symmetry" not in self.meta:
            return None
        try:
            return ObjectSymmetry.from_json(self.meta["symmetry"])
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{self.source}: symmetry that cannot be read ({error}); build it again") from error

    def save(self, path: str | Path) -> None:
        """Write one `.npz`; nothing is left behind if it fails."""
        poses, codes = se3.to_xyzquat(self.poses).astype(np.float32), self.codes.astype(np.float16)
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            np.savez(
                stream,
                poses=poses,
                codes=codes,
                meta=np.array(json.dumps(self.meta)),
                checksum=_checksum(poses, codes),
                **self.derived,  # type: ignore[arg-type] # none has the name of an option
            )

    @classmethod
    def load(
        cls, path: str | Path, mesh: ObjectMesh | None = None, tcn: str | None = None, first: int | None = None
    ) -> Codebook:
        """Read a codebook.

        Parameters
        ----------
        path
            File, from `midastouch build-codebook`.
        mesh
            The mesh that it must be of, if given.
        tcn
            Id of the network that it must be of, if given.
        first
            Number of poses to read, without `derived`; None for all. Sites come in farthest-point order, so the first
            ones are spread over the object as evenly as all.

        Raises
        ------
        InputError
            No such file, no codebook, other format version, non-finite content, other mesh or network.
        """
        try:
            path = require_file(path, "codebook")
        except InputError as error:
            raise InputError(f"{error}, or build it: midastouch build-codebook MESH --sensor MODEL") from error
        with readable(path, "not a codebook", "build it with midastouch build-codebook"):
            data = read_npz(path) if first is None else mapped_npz(path)
            if first is None and "checksum" in data and data["checksum"] != _checksum(data["poses"], data["codes"]):
                raise InputError("its poses and codes are not those that were written")
            poses, codes = (data[name][:first].astype(np.float32) for name in ("poses", "codes"))
            with np.load(path, allow_pickle=False) as checked:
                meta = json.loads(str(checked["meta"]))
            derived = {name: data[name] for name in data if name not in _CONTENT and first is None}
        if not isinstance(meta, dict):
            raise InputError(f"{path}: not a codebook (no description); build it with midastouch build-codebook")
        if meta.get("format") != FORMAT:
            raise InputError(f"{path}: codebook format {meta.get('format')}, need {FORMAT}; build it again")
        if codes.ndim != 2 or poses.shape != (len(codes), 7) or not len(codes):
            raise InputError(f"{path}: {poses.shape} poses do not fit {codes.shape} codes; build it again")
        if missing := ", ".join(key for key in _DESCRIPTION if key not in meta):
            raise InputError(f"{path}: codebook without its {missing}; build it again")
        if not (np.isfinite(codes).all() and np.isfinite(poses).all()):
            raise InputError(f"{path}: non-finite poses or codes; build it again")
        if np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1).max() > 1e-3:
            raise InputError(f"{path}: poses whose quaternions are not of unit length; build it again")
        lengths = np.linalg.norm(codes, axis=1, keepdims=True)
        if np.abs(lengths - 1).max() > _ROUNDED:
            raise InputError(f"{path}: codes that are not of unit length; build it again")
        if mesh is not None and mesh.sha256 != meta["mesh_sha256"]:
            built_for = meta["mesh_name"]
            other = f"give the other mesh, or: {build_command(mesh.path or mesh.name)}"
            fix = "build it again" if built_for == mesh.name else other
            raise InputError(f"{path}: built for the mesh '{built_for}', not for this '{mesh.name}'; {fix}")
        if tcn is not None and tcn != meta["tcn"]:
            raise InputError(f"{path}: built with the network {meta['tcn']}, not with {tcn}; build it again")
        book = cls(se3.from_xyzquat(poses), codes / lengths, meta, derived, str(path))
        if mesh is not None:
            book._require_on(mesh)
        return book

    def _require_on(self, mesh: ObjectMesh) -> None:
        """Raise InputError unless all poses touch points within the bounds of the mesh, to 5 mm."""
        touched = self.poses[:, :3, 3] + PRESS * self.poses[:, :3, 2]
        low, high = mesh.bounds
        outside = max((low - touched).max(), (touched - high).max())
        if outside > _OUTSIDE:
            raise InputError(
                f"{self.source}: its poses touch points {1e3 * outside:.0f} mm outside the mesh "
                f"{mesh.path or mesh.name}; the two do not belong together: midastouch build-codebook makes it again"
            )


def _checksum(*arrays: np.ndarray) -> int:
    return zlib.crc32(b"".join(array.tobytes() for array in arrays))


def mapped_npz(path: str | Path) -> dict[str, np.ndarray]:
    """Map the arrays of an `.npz` read-only, by name. Raises ValueError if one is compressed or holds objects."""
    out = {}
    with zipfile.ZipFile(path) as archive, Path(path).open("rb") as stream:
        for member in archive.infolist():
            if member.compress_type != zipfile.ZIP_STORED:
                raise ValueError(f"{member.filename} is compressed")
            stream.seek(member.header_offset + _LENGTHS)
            stream.seek(sum(struct.unpack("<HH", stream.read(4))), 1)
            shape, fortran, dtype = _HEADERS[np.lib.format.read_magic(stream)](stream)
            if dtype.hasobject:
                raise ValueError(f"{member.filename} holds objects")
            order: Literal["C", "F"] = "F" if fortran else "C"
            name = member.filename.removesuffix(".npy")
            empty = not np.prod(shape, dtype=int)  # nothing to map
            out[name] = np.empty(shape, dtype) if empty else np.memmap(path, dtype, "r", stream.tell(), shape, order)
    return out
