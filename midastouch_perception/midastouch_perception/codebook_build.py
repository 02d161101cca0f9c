"""Build of a codebook: rendered and encoded chunk by chunk, so that it can be interrupted, saved and continued."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, readable, require_file
from midastouch_common.mesh import ObjectMesh

from .codebook import FORMAT, Codebook, codebook_poses
from .mesh_report import MeshReport
from .rendering.renderer import PenetrationRenderer
from .sensor_model import SensorModel
from .symmetry.group import Symmetry
from .symmetry.search import ObjectSymmetry, object_symmetry
from .tcn.inference import AnyCodeNet

CHUNK = 256
"""Number of poses that are rendered, encoded and kept together; the result must not depend on it."""

_ARRAYS = ("poses", "codes", "finished")


class CodebookBuild:
    """Unfinished codebook of `size` poses of a mesh.

    Args: mesh; tcn; sensor, at image resolution; size; seed, of the poses; symmetry, if the user gives it, otherwise it
    is searched for. The result depends on these alone, not on interruptions or the number of jobs. Maps are encoded as
    rendered: the code network was trained to match the depth network's maps with them.
    """

    def __init__(
        self,
        mesh: ObjectMesh,
        tcn: AnyCodeNet,
        sensor: SensorModel,
        size: int = 50_000,
        seed: int = 0,
        symmetry: Symmetry | None = None,
    ):
        self._mesh, self._tcn, self._sensor = mesh, tcn, sensor
        self._meta: dict[str, Any] = {
            "format": FORMAT,
            "mesh_name": mesh.name,
            "mesh_sha256": mesh.sha256,
            "mesh_path": str(mesh.path) if mesh.path else "",
            "sensor": sensor.name,
            "sensor_id": sensor.content_id,
            "sensor_model": sensor.as_json(),
            "tcn": tcn.network_id,
            **tcn.calibration,
            "size": size,
            "seed": seed,
        }
        self._given = symmetry
        self._symmetry: ObjectSymmetry | None = None
        self._poses: np.ndarray | None = None  # (M, 4, 4), laid out when the work begins
        self._codes = np.empty((0, tcn.dim), np.float32)
        self._finished = np.zeros(0, bool)  # by chunk

    @property
    def done(self) -> int:
        """Number of poses encoded so far."""
        chunks = np.flatnonzero(self._finished)
        return int(np.minimum((chunks + 1) * CHUNK, self._meta["size"]).sum() - (chunks * CHUNK).sum())

    def run(
        self,
        jobs: int = 1,
        progress: Callable[[int, int], None] = lambda done, total: None,
        pause: Callable[[], None] = lambda: None,
        inform: Callable[[str], None] = lambda line: None,
        searched: Callable[[int], None] = lambda found: None,
        tried: Callable[[], object] = lambda: None,
    ) -> Codebook:
        """Do the remaining work, encoding `jobs` chunks at a time; `progress(done, total)` is called after each.

        pause: called now and then; an exception from it ends the run, and the finished part can be saved. inform: gets
        a report on the mesh, with warnings, line by line. searched: as in `codebook_poses`. tried: called for each
        motion that could be a symmetry. Raises InputError if no pose can be encoded, or if too many poses on the mesh
        would lie within the object.
        """
        size, seed = self._meta["size"], self._meta["seed"]
        if self._poses is None:
            MeshReport.tell(self._mesh, self._sensor, inform)
            rng = np.random.default_rng(seed)
            self._poses = codebook_poses(self._mesh, size, self._sensor, rng, pause, searched)
            self._codes = np.empty((size, self._tcn.dim), np.float32)
            self._finished = np.zeros(-(-size // CHUNK), bool)
        if self._symmetry is None:
            self._symmetry = object_symmetry(self._mesh, self._sensor, self._poses, self._given, tried)
        renderer = PenetrationRenderer(self._mesh, self._sensor.for_maps)
        waiting: deque = deque()

        def collect() -> None:
            chunk, codes = waiting.popleft()
            self._codes[_part(chunk)] = codes.result()
            self._finished[chunk] = True
            progress(self.done, len(self._poses))

        # threads, not processes: network and renderer release the interpreter lock, and no data has to be sent
        with ThreadPoolExecutor(jobs) as pool:
            for chunk in np.flatnonzero(~self._finished):
                pause()
                maps = renderer.render(self._poses[_part(chunk)])
                waiting.append((chunk, pool.submit(self._tcn.encode, maps)))
                if len(waiting) > jobs:
                    collect()
            while waiting:
                collect()
        return Codebook(self._poses, self._codes, self._meta | {"symmetry": self._symmetry.as_json()})

    def save(self, path: str | Path) -> None:
        """Write the finished part to one `.npz`, for `restore`; nothing is left behind if it fails."""
        if self._poses is None:
            raise ValueError("nothing is done yet")
        codes = np.where(np.repeat(self._finished, CHUNK)[: len(self._codes), None], self._codes, 0)
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            np.savez(stream, poses=self._poses, codes=codes, finished=self._finished, meta=np.array(self._identity()))

    def restore(self, path: str | Path) -> None:
        """Continue from the file that an interrupted build of the same codebook saved.

        Raises InputError, and changes nothing, if the file is missing, broken, no unfinished codebook, or of another
        mesh, network, sensor, size or seed.
        """
        path = require_file(path, "unfinished codebook")
        checked = readable(path, "not an unfinished codebook", "remove it")
        with checked, np.load(path, allow_pickle=False) as data:
            poses, codes, finished = (data[name] for name in _ARRAYS)
            identity = json.loads(str(data["meta"]))
        wanted = json.loads(self._identity())
        if identity != wanted:
            other = identity if isinstance(identity, dict) else {}
            differing = ", ".join(key for key in wanted if other.get(key) != wanted[key]) or "format"
            raise InputError(f"{path}: unfinished codebook of another {differing}; remove it")
        size, dim = wanted["size"], self._tcn.dim
        fits = poses.shape == (size, 4, 4) and codes.shape == (size, dim) and finished.shape == (-(-size // CHUNK),)
        if not (fits and finished.dtype == bool and np.isfinite(poses).all() and np.isfinite(codes).all()):
            raise InputError(f"{path}: unfinished codebook with missing or non-finite content; remove it")
        self._poses, self._codes, self._finished = poses.astype(float), codes.astype(np.float32), finished

    def _identity(self) -> str:
        """Return the inputs that the result depends on, as JSON, without the mesh's path, which may have changed."""
        return json.dumps({key: value for key, value in self._meta.items() if key != "mesh_path"})


def build_codebook(
    mesh: ObjectMesh, tcn: AnyCodeNet, sensor: SensorModel, size: int = 50_000, seed: int = 0
) -> Codebook:
    """Build a codebook in one go (paper section 4.2).

    Parameters
    ----------
    mesh
    tcn
        Code network, from `load_tcn`.
    sensor
        Sensor model at image resolution.
    size : number of poses
    seed

    Returns
    -------
    Codebook
        The same for the same arguments.

    Raises
    ------
    InputError
        Too few poses of the object can be reached.
    """
    return CodebookBuild(mesh, tcn, sensor, size, seed).run()


def _part(chunk: np.integer) -> slice:
    return slice(chunk * CHUNK, (chunk + 1) * CHUNK)
