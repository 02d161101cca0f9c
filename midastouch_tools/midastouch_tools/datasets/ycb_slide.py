"""Reading of YCB-Slide sequences, simulated or real.

The format follows the two readers that the authors of the dataset publish; poses are rows
[x y z qx qy qz qw] in metres.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import readable, require_file
from midastouch_common.images import read_image_file
from midastouch_common.message_arrays import SECOND
from midastouch_perception.sensor_model import SensorModel

from . import restricted_pickle
from .sequence import Sequence

_SIMULATED_PERIOD = SECOND // 10  # the paper's loop plays simulated slides at 10 Hz; they carry no stamps
_FIRST_STAMP = SECOND

HEIGHT_UNIT = 3e-5
"""m per grey level of gt_heightmaps."""
# Rounding and JPEG leave noise of 0.0097 mm (one sigma) outside contacts; up to four sigma count as zero.
_HEIGHT_NOISE = 4e-5

_REAL_STRIDE = 2  # 30 Hz cameras, used at 15 Hz as in the paper
_JUMP_FACTOR = 10.0  # times the mean step, as the paper's reader
_SMALLEST_JUMP = 0.005  # m: if the sensor mostly rests, the mean step is tiny, and ten times it is no jump

_PAPERS_SIMULATED, _REAL_SENSOR = "digit_tacto", "digit_real"

PENETRATION_FILE = "penetration_truth.npz"
BACKGROUND_FILE = "background.png"


SIMULATED_FILE, REAL_FILE = "tactile_data.pkl", "synced_data.npy"
"""File that identifies each layout."""


def load_simulated(path: Path) -> Sequence:
    """Load the simulated slide in folder `path`; raises as `load_sequence`."""
    file = path / SIMULATED_FILE
    data = _require_keys(restricted_pickle.load(file), ("gelposes", "gelposes_meas"), file)
    true, measured = _transforms(data["gelposes"], file), _transforms(data["gelposes_meas"], file)
    if len(true) != len(measured):
        raise InputError(f"{file}: {len(true)} gelposes but {len(measured)} gelposes_meas; get the file again")
    n = len(true)
    images = _numbered_images(path / "tactile_images", n)
    return Sequence(
        path=path,
        object_name=str(data.get("object_name", path.resolve().parent.name)),
        layout="simulated",
        sensor=str(data.get("sensor", _PAPERS_SIMULATED)),
        image_paths=images,
        stamps_ns=_FIRST_STAMP + _SIMULATED_PERIOD * np.arange(n),
        poses_true=true,
        poses_measured=measured,
        background_path=_background(path),
        penetration_sources={**_height_maps(path / "gt_heightmaps", n), **_exact_penetrations(path, n)},
    )


def _numbered_images(folder: Path, n: int) -> tuple[Path, ...]:
    """Return the paths of `0.jpg` ... `n-1.jpg` in order of their numbers."""
    found = {int(file.stem) for file in folder.glob("*.jpg") if file.stem.isdecimal()}
    if missing := set(range(n)) - found:
        raise InputError(
            f"{folder}: {n} poses, {len(found)} images, {min(missing)}.jpg is missing; get the folder again"
        )
    return tuple(folder / f"{i}.jpg" for i in range(n))


def _background(path: Path) -> Path | None:
    file = path / BACKGROUND_FILE
    return file if file.is_file() else None


def _exact_penetrations(path: Path, n: int) -> dict[int, Callable[[], np.ndarray]]:
    """Penetration maps by frame, stored in micrometres in addition to the original layout."""
    file = path / PENETRATION_FILE
    if not file.is_file():
        return {}

    def stored(key: str) -> np.ndarray:
        with readable(file, "cannot be read", "get the file again"), np.load(file, allow_pickle=False) as content:
            return content[key]

    frames = stored("frames").tolist()

    @functools.cache
    def maps() -> np.ndarray:
        micrometres = stored("penetration_um")
        if micrometres.shape != (len(frames), 320, 240):
            raise InputError(f"{file}: maps {micrometres.shape} for {len(frames)} frames; get the file again")
        return micrometres

    def read(row: int) -> np.ndarray:
        return maps()[row].astype(np.float32) * np.float32(1e-6)

    return {frame: functools.partial(read, row) for row, frame in enumerate(frames) if frame in range(n)}


def _height_maps(folder: Path, n: int) -> dict[int, Callable[[], np.ndarray]]:
    """Penetration maps recovered from the 8-bit height maps, by frame."""
    numbers = (int(file.stem) for file in folder.glob("*.jpg") if file.stem.isdecimal())
    return {i: functools.partial(_penetration_of_height_map, folder / f"{i}.jpg") for i in numbers if i < n}


def _penetration_of_height_map(file: Path) -> np.ndarray:
    """Penetration (320, 240) float32, metres: height over the apex plane minus the undeformed dome's."""
    heights = read_image_file(file, cv2.IMREAD_GRAYSCALE)
    if heights.shape != (320, 240):
        raise InputError(f"{file}: not a height map of 240 x 320; get the file again")
    penetration = heights * HEIGHT_UNIT - _dome_height()
    return np.where(penetration > _HEIGHT_NOISE, penetration, 0).astype(np.float32)


@functools.cache
def _dome_height() -> np.ndarray:
    """Height (320, 240) m of the undeformed gel over its apex plane; simulated slides are `digit_tacto`'s."""
    sensor = SensorModel.load(_PAPERS_SIMULATED)
    return sensor.gel_distance - sensor.gel_depth


def load_real(path: Path) -> Sequence:
    """Load the real slide in folder `path`; raises as `load_sequence`."""
    file = path / REAL_FILE
    data = _require_keys(restricted_pickle.load_npy(file), ("poses", "timestamps", "digit_frames"), file)
    tracked = _require_keys(data["poses"], ("DIGIT",), file)
    objects = [str(key) for key in tracked if key != "DIGIT"]
    if len(objects) != 1:
        raise InputError(f"{file}: poses of {objects or 'no object'} beside DIGIT, expected exactly one object")
    world_digit, world_object = (_rows(tracked[key], file) for key in ("DIGIT", objects[0]))
    try:
        times = np.asarray(data["timestamps"], float).reshape(-1)
        names = [Path(str(name)).name for name in data["digit_frames"]]
    except (TypeError, ValueError) as error:
        raise InputError(f"{file}: timestamps or digit_frames are no lists ({error}); get the file again") from error
    counts = {"poses": len(world_digit), "object poses": len(world_object), "images": len(names)}
    if set(counts.values()) != {len(times)}:
        raise InputError(f"{file}: {len(times)} timestamps but {counts}; get the file again")

    candidates = np.arange(0, len(times), _REAL_STRIDE)
    n_candidates = len(candidates)
    candidates = candidates[_is_later(times[candidates])]
    candidates = candidates[_is_tracked(world_digit[candidates]) & _is_tracked(world_object[candidates])]
    poses = _object_from_gel(world_digit[candidates], world_object[candidates], _alignment(path))
    steady = _without_jumps(poses[:, :3, 3])
    kept, poses = candidates[steady], poses[steady]
    if len(kept) == 0:
        raise InputError(f"{file}: no frame has a tracked pose; choose another sequence")
    return Sequence(
        path=path,
        object_name=objects[0],
        layout="real",
        sensor=_REAL_SENSOR,
        image_paths=_existing([path / "frames" / names[i] for i in kept]),
        stamps_ns=_FIRST_STAMP + np.round(times[kept] * SECOND).astype(np.int64),
        poses_true=poses,
        poses_measured=poses,
        background_path=_background(path),
        dropped_frames=n_candidates - len(kept),
    )


def _alignment(path: Path) -> np.ndarray:
    """The sequence's calibration (4, 4) between tracked body and mesh, stored one level up."""
    file = path.resolve().parent / "alignment.npy"
    alignment = np.asarray(restricted_pickle.load_npy(require_file(file, "alignment")))
    if alignment.shape != (4, 4) or alignment.dtype.kind != "f" or not np.isfinite(alignment).all():
        raise InputError(f"{file}: not a (4, 4) matrix of finite numbers; get the file again")
    return alignment


def _object_from_gel(world_digit: np.ndarray, world_object: np.ndarray, alignment: np.ndarray) -> np.ndarray:
    """Return T_obj_gel (N, 4, 4) of tracked rows (N, 7).

    The alignment A corrects only the camera's translation t, which becomes that of [I | t] A; the rotation stays.
    The gel's apex lies 22 mm in front of the camera.
    """
    object_from_camera = se3.inverse(se3.from_xyzquat(world_object)) @ se3.from_xyzquat(world_digit)
    object_from_camera[:, :3, 3] += alignment[:3, 3]
    gel_distance = SensorModel.load(_REAL_SENSOR).gel_distance
    return object_from_camera @ se3.translation([0, 0, -gel_distance])


def _is_later(times: np.ndarray) -> np.ndarray:
    """Mask (N,) of the times that are finite and later than all before them."""
    finite = np.where(np.isfinite(times), times, -np.inf)
    latest_before = np.concatenate([[-np.inf], np.maximum.accumulate(finite)[:-1]])
    return finite > latest_before


def _is_tracked(rows: np.ndarray) -> np.ndarray:
    """Mask (N,) of the rows (N, 7) that the tracker really saw: finite, with a non-zero quaternion."""
    return np.isfinite(rows).all(axis=1) & (np.linalg.norm(np.nan_to_num(rows[:, 3:]), axis=1) > 1e-6)


def _without_jumps(positions: np.ndarray) -> np.ndarray:
    """Mask (N,) of the positions (N, 3) that do not jump off the path.

    A step is a jump if it is more than ten times the mean of the ordinary steps (the shortest 95 %). Steps are
    measured from the last frame kept and divided by the frames since, so that a track that stays elsewhere is
    picked up again. The paper's reader drops such poses but keeps their images, so that the two no longer match.
    """
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    if len(steps) == 0:
        return np.ones(len(positions), bool)
    ordinary = steps[steps <= np.quantile(steps, 0.95)]
    bound = max(_JUMP_FACTOR * ordinary.mean(), _SMALLEST_JUMP)
    keep = np.zeros(len(positions), bool)
    last = int(np.argmax(steps <= bound))
    keep[last] = True
    for i in range(last + 1, len(positions)):
        if np.linalg.norm(positions[i] - positions[last]) <= bound * (i - last):
            keep[i] = True
            last = i
    return keep


def _existing(files: list[Path]) -> tuple[Path, ...]:
    present = {file.name for file in files[0].parent.glob("*")}
    for file in files:
        if file.name not in present:
            raise InputError(f"{file}: missing image; get the sequence again")
    return tuple(files)


def _require_keys(data: Any, keys: tuple[str, ...], file: Path) -> dict:
    if not isinstance(data, dict):
        raise InputError(f"{file}: holds {type(data).__name__}, expected a dictionary; get the file again")
    if missing := [key for key in keys if key not in data]:
        raise InputError(f"{file}: has no {', '.join(missing)}; it has {', '.join(map(str, data)) or 'nothing'}")
    return data


def _rows(value: Any, file: Path) -> np.ndarray:
    try:
        rows = np.asarray(value, float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{file}: poses are not numbers ({error}); get the file again") from error
    if rows.ndim != 2 or rows.shape[1] != 7 or len(rows) == 0:
        raise InputError(f"{file}: poses of shape {rows.shape}, expected (N, 7); get the file again")
    return rows


def _transforms(value: Any, file: Path) -> np.ndarray:
    rows = _rows(value, file)
    try:
        return se3.from_xyzquat(rows)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
