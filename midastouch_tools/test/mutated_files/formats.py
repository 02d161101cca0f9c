"""Formats of files that users give: how a small good one is written, and how commands read it."""

from __future__ import annotations

import dataclasses
import json
import shutil
import tempfile
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import trimesh
from foreign_bags import images_as, of_humble, raw, without_index, write_bag
from recorded import write
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from run_results import write_run
from sequences import bump, smooth_image, write_real, write_touches, write_video

import digit_driver
from digit_driver.camera_info import load_intrinsics
from digit_driver.camera_model import CameraModel
from midastouch_bringup.parameter_files import read_parameters, written
from midastouch_common import se3
from midastouch_common.images import read_image_file
from midastouch_common.mesh import ObjectMesh
from midastouch_perception import onnx_network, sensor_model
from midastouch_perception.codebook import Codebook
from midastouch_perception.mesh_report import MeshReport
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.bop import symmetry_of_bop
from midastouch_perception.tcn import load_tcn
from midastouch_perception.tdn.inference import load_tdn
from midastouch_simulation import measured_optics
from midastouch_simulation.measured_optics import MeasuredOptics
from midastouch_simulation.optics import ColourTable
from midastouch_tools.bags.images import read_bag
from midastouch_tools.bags.run_record import read_run
from midastouch_tools.datasets import load_sequence
from midastouch_tools.datasets.ball_presses import load_ball_presses
from midastouch_tools.download.archive import extract
from midastouch_tools.replay.inspection import inspect_bag
from midastouch_tools.replay.source import ReplaySource
from midastouch_tools.result_file import read_json, write_json


@dataclasses.dataclass(frozen=True)
class Format:
    """A format of a file or folder.

    write: makes a good one in a folder and returns its path; reads: functions that read it, each of which returns all
    content that is used later; checked: True if a checksum covers the content; text: True for readable text; files:
    pattern of those that are mutated.
    """

    write: Callable[[Path], Path]
    reads: tuple[Callable[[Path], object], ...]
    checked: bool = False
    text: bool = False
    files: str = "*"


def _mesh(ending: str, folder: Path, **options) -> Path:
    path = folder / f"part{ending}"
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    ball.export(path, **options)
    return path


def _read_mesh(path: Path) -> object:
    mesh = ObjectMesh.load(path)
    report = MeshReport.of(mesh)
    report.require_usable()
    return mesh.vertices, mesh.faces, mesh.face_normals, mesh.vertex_normals, mesh.corner_normals, report


def _codebook(folder: Path) -> Path:
    rng = np.random.default_rng(0)
    codes = rng.normal(size=(60, 16))
    sensor = SensorModel.load("digit_tacto").for_maps
    meta = {"format": 1, "mesh_name": "ball", "mesh_sha256": "0", "sensor": "digit_tacto", "tcn": "tcn"}
    meta |= {"sensor_id": sensor.content_id, "sensor_model": sensor.as_json(), "symmetry": {"none": []}}
    poses = se3.make(se3.random_rotations(60, rng), rng.normal(0, 0.02, (60, 3)))
    codes /= np.linalg.norm(codes, axis=1, keepdims=True)
    Codebook(poses, codes, meta, {"kept": rng.normal(size=(60, 3))}).save(folder / "part.npz")
    return folder / "part.npz"


def _read_codebook(path: Path, first: int | None = None) -> object:
    book = Codebook.load(path, first=first)
    return book.poses, book.codes, book.meta, book.derived, SensorModel.of_codebook(book.meta)


def _calibration(folder: Path) -> Path:
    rng, path = np.random.default_rng(0), folder / "D20123.calibration.npz"
    sensor = SensorModel.load("digit_real")
    factors, colours = rng.normal(0, 0.1, (12, 6, 2)), rng.uniform(60, 150, (16, 12, 3))
    SensorCalibration("D20123", 6e-3, "digit_real", sensor.pixel_size, factors, colours, 10, "2026-11-22").save(path)
    return path


def _colour_table(folder: Path) -> Path:
    rng, path = np.random.default_rng(0), folder / "polycalib.npz"
    np.savez(path, **{f"grad_{colour}": rng.normal(size=(4, 5, 6)) for colour in "rgb"})
    return path


def _simulated(folder: Path) -> Path:
    return write_touches(folder / "test_object" / "00", 2).path


def _trial(folder: Path) -> Path:
    path = folder / "box0"
    path.mkdir()
    write_video(path / "gelsight.avi", [np.ascontiguousarray(smooth_image(i).swapaxes(0, 1)) for i in range(3)])
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[1:, :3, 3] = 1e-3
    np.save(path / "true_start_T_currs.npy", poses)
    return path


def _read_sequence(path: Path) -> object:
    sequence = load_sequence(path)
    images = [sequence.image(i) for i in range(sequence.n_frames)]
    truths = [sequence.penetration_truth(i) for i in sequence.ground_truth_frames]
    poses = sequence.stamps_ns, sequence.poses_true, sequence.poses_measured
    return sequence.object_name, sequence.sensor, poses, sequence.background, images, truths


_MESSAGES = images_as(raw("/image_raw", change=lambda pixels: pixels[::8, ::8]))
"""Of an arm with a sensor of small images."""


def _bag(storage: StoragePlugin, mode: CompressionMode, folder: Path) -> Path:
    return write_bag(folder / "bag", _MESSAGES, storage, mode)


def _read_frames(path: Path) -> object:
    return [tuple(frame) for frame in read_bag(path)]


def _played(path: Path) -> object:
    source = ReplaySource(path)
    return source.topics, source.duration_s, source.pose_missing("base_link", "digit_gel_frame"), [*source.messages()]


_READ_BAG = (_read_frames, _played, inspect_bag)


def _run(folder: Path) -> Path:
    return write_run(load_sequence(_simulated(folder)), folder / "run.mcap", range(2))


def _archive(folder: Path) -> Path:
    path = folder / "slides.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for i in range(3):
            archive.writestr(f"slide/{i}.txt", f"{i} " * 500)
    return path


def _unpacked(path: Path) -> object:
    with tempfile.TemporaryDirectory() as folder:
        extract(path, Path(folder) / "there")
        return {str(file.relative_to(folder)): file.read_bytes() for file in Path(folder).rglob("*.txt")}


def _image(ending: str, folder: Path) -> Path:
    path = folder / f"background{ending}"
    cv2.imwrite(str(path), smooth_image(0))
    return path


def _presses(folder: Path) -> Path:
    lines = ["frame,center_x_px,center_y_px,radius_px"]
    for i in range(3):
        cv2.imwrite(str(folder / f"{i:04d}.png"), cv2.circle(smooth_image(i), (60 + 50 * i, 90), 30, (9, 9, 9), -1))
        lines.append(f"{i:04d},{60 + 50 * i},90,30")
    cv2.imwrite(str(folder / "background.png"), smooth_image(0))
    (folder / "circles.csv").write_text("\n".join(lines) + "\n")
    return folder


def _read_presses(path: Path) -> object:
    presses = load_ball_presses(path)
    return presses.images, presses.background, presses.circles


def _copied(source: Path, folder: Path) -> Path:
    return Path(shutil.copy(source, folder))


def _sensor(folder: Path) -> Path:
    return _copied(Path(sensor_model.__file__).parent / "sensor_models" / "digit_real.yaml", folder)


def _read_sensor(path: Path) -> object:
    model = SensorModel.load(path)
    return dataclasses.replace(model, name="", lamps="", light=""), model.gel_depth


def _camera(folder: Path) -> Path:
    return _copied(Path(digit_driver.__file__).parent / "cameras" / "gelsight_mini.yaml", folder)


def _camera_info(folder: Path) -> Path:
    path = folder / "info.yaml"
    lines = ["image_width: 240", "image_height: 320", "distortion_model: plumb_bob"]
    for name, count in {"camera": 9, "rectification": 9, "projection": 12}.items():
        lines.append(f"{name}_matrix: {{rows: 3, cols: {count // 3}, data: {[1.5] * count}}}")
    lines.append(f"distortion_coefficients: {{rows: 1, cols: 5, data: {[0.1] * 5}}}")
    path.write_text("\n".join(lines) + "\n")
    return path


def _parameters(folder: Path) -> Path:
    path = folder / "overlay.yaml"
    path.write_text(written({"tdn": {"sensor_model": "digit_real", "rate": 1.5, "a.b": [1, 2]}, "**": {"x": True}}, ""))
    return path


def _symmetries(folder: Path) -> Path:
    path = folder / "models_info.json"
    half = np.diag([-1.0, -1, 1, 1])
    axis = {"axis": [0, 0, 1], "offset": [0, 0, 0.5]}
    content = {"5": {"diameter": 100, "symmetries_discrete": [half.ravel().tolist()], "symmetries_continuous": [axis]}}
    path.write_text(json.dumps(content))
    return path


def _result(folder: Path) -> Path:
    write_json(folder / "result.json", {"right": True, "error_mm": [1.5, 2.5], "states": {"converged": 3}})
    return folder / "result.json"


def _network(name: str, folder: Path) -> Path:
    _copied(onnx_network.WEIGHTS / f"{name}.json", folder)
    return _copied(onnx_network.WEIGHTS / f"{name}.onnx", folder)


def _depth(path: Path) -> object:
    sensor = SensorModel.load("digit_tacto")
    return load_tdn(path, sensor).predict(smooth_image(3), smooth_image(0))


def _code(path: Path) -> object:
    network = load_tcn(path)
    return network.encode(bump(3)[::2, ::2]), network.calibration, network.dim


FORMATS = {
    "ply": Format(partial(_mesh, ".ply"), (_read_mesh,)),
    "ply_text": Format(partial(_mesh, ".ply", encoding="ascii"), (_read_mesh,), text=True),
    "stl": Format(partial(_mesh, ".stl"), (_read_mesh,)),
    "stl_text": Format(partial(_mesh, ".stl", file_type="stl_ascii"), (_read_mesh,), text=True),
    "obj": Format(partial(_mesh, ".obj"), (_read_mesh,), text=True),
    "glb": Format(partial(_mesh, ".glb"), (_read_mesh,)),
    "off": Format(partial(_mesh, ".off"), (_read_mesh,), text=True),
    "codebook": Format(_codebook, (_read_codebook,), checked=True),
    "codebook_beginning": Format(_codebook, (partial(_read_codebook, first=20),)),
    "calibration": Format(_calibration, (SensorCalibration.load,), checked=True),
    "colour_table": Format(_colour_table, (lambda path: ColourTable.load(path) and "read",), checked=True),
    "simulated_slide": Format(_simulated, (_read_sequence,), files="*[!0-9].*"),
    "real_slide": Format(lambda folder: write_real(folder, 5)[0], (_read_sequence,), files="*.npy"),
    "trial": Format(_trial, (_read_sequence,)),
    "bag_of_ours": Format(lambda folder: write(folder / "bag.mcap", *_MESSAGES), _READ_BAG, checked=True),
    "bag_mcap": Format(partial(_bag, StoragePlugin.MCAP, CompressionMode.NONE), _READ_BAG),
    "bag_sqlite": Format(partial(_bag, StoragePlugin.SQLITE3, CompressionMode.NONE), _READ_BAG),
    "bag_zstd": Format(partial(_bag, StoragePlugin.SQLITE3, CompressionMode.MESSAGE), _READ_BAG),
    "bag_of_humble": Format(lambda folder: of_humble(folder / "bag"), _READ_BAG, text=True, files="*.yaml"),
    "bag_without_index": Format(lambda folder: without_index(folder / "bag.mcap"), _READ_BAG),
    "run": Format(_run, (read_run,), checked=True, files="*.mcap"),
    "archive": Format(_archive, (_unpacked,)),
    "png": Format(partial(_image, ".png"), (read_image_file,), checked=True),
    "jpg": Format(partial(_image, ".jpg"), (read_image_file,)),
    "presses": Format(_presses, (_read_presses,), text=True, files="*.csv"),
    "sensor_model": Format(_sensor, (_read_sensor,), text=True),
    "camera_model": Format(_camera, (CameraModel.load,), text=True),
    "camera_info": Format(_camera_info, (lambda path: load_intrinsics(str(path), (240, 320)),), text=True),
    "parameters": Format(_parameters, (lambda path: repr(read_parameters(path)),), text=True),
    "symmetries": Format(_symmetries, (lambda path: symmetry_of_bop(str(path)),), text=True),
    "measured_optics": Format(
        partial(_copied, Path(measured_optics.__file__).parent / "measured_sensors" / "d20641.json"),
        (MeasuredOptics.load,),
        text=True,
    ),
    "result": Format(_result, (read_json,), text=True),
    "depth_network": Format(partial(_network, "tdn_fast"), (_depth,), files="*.onnx"),
    "code_network": Format(partial(_network, "tcn_fast"), (_code,), files="*.onnx"),
    "model_card": Format(partial(_network, "tcn_fast"), (_code,), text=True, files="*.json"),
}
