"""Input of a training run: its options, and the meshes and no-contact images that they name.

The objects are YCB scans other than the paper's test objects, and shapes and parts made by code; the images are of
many DIGITs.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import cv2
import numpy as np

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.files import require_folder
from midastouch_common.images import image_files, read_image_file
from midastouch_common.mesh import ObjectMesh
from midastouch_perception.onnx_network import network_path
from midastouch_perception.sensor_model import SensorModel

from ..optics import ColourTable
from ..procedural import random_probe, random_shape
from ..random_parts import random_part
from ..randomisation import RandomisationRange

MAKERS = random_shape, random_part, random_probe, random_part
"""Functions that make objects by code, used in turn: half of the objects have sharp edges."""

PROCEDURAL_OBJECTS = 48
_HELD_OUT_PARTS = 1 / 16  # of the procedural objects: scans have no sharp edges to validate with
_OTHER_DESIGNS = 0.2  # of the sensors with relative light, so that a new kind of gel works without training for it
_FAR_SENSORS = 0.25  # of the sensors with additive light; few, for without a known scale a depth can only be guessed
HELD_OUT = 4  # images, the last ones by name, that are used only to validate
# the paper's ten test objects: never trained on
TEST_OBJECTS = ("004_", "005_", "006_", "021_", "025_", "035_", "037_", "042_", "048_", "055_")
# of the training scans, these measure generalisation while training
VALIDATION_OBJECTS = ("019_", "032_", "043_", "052_", "065-c_", "072-b_", "073-a_")
_STRETCH = 0.7, 1.4


def load_objects(folder: str | Path, procedural: int, seed: int) -> tuple[list[ObjectMesh], list[ObjectMesh]]:
    """Return training and validation meshes: the PLY files of `folder` except the test objects, and `procedural` random
    shapes, half of them parts with sharp edges.

    Raises InputError if the folder holds no usable mesh.
    """
    paths = [p for p in sorted(Path(folder).glob("*.ply")) if not p.name.startswith(TEST_OBJECTS)]
    if not paths:
        raise InputError(
            f"{folder}: no training meshes (*.ply) here; give the folder of YCB scans as --meshes "
            "(midastouch download ycb-mesh gets some)"
        )
    meshes = [ObjectMesh.load(path) for path in paths]
    held_out = [mesh for mesh in meshes if mesh.name.startswith(VALIDATION_OBJECTS)]
    rng = np.random.default_rng(seed)
    shapes = [MAKERS[i % len(MAKERS)](rng, f"procedural_{i}") for i in range(procedural)]
    held_out_parts = [random_part(rng, f"held_out_{i}") for i in range(int(_HELD_OUT_PARTS * procedural))]
    return [mesh for mesh in meshes if mesh not in held_out] + shapes, held_out + held_out_parts


def stretched(mesh: ObjectMesh, rng: np.random.Generator) -> ObjectMesh:
    """Return another object: the mesh scaled along three perpendicular directions, each by a factor of 0.7 to 1.4."""
    axes = se3.exp(np.r_[np.zeros(3), rng.uniform(-np.pi, np.pi, 3)])[:3, :3]
    low, high = np.log(_STRETCH)
    scale = axes * np.exp(rng.uniform(low, high, 3)) @ axes.T
    return ObjectMesh(mesh.vertices @ scale, mesh.faces, mesh.name, mesh.sha256)


def load_backgrounds(folder: str | Path, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return training and validation images (B, height, width, 3) uint8 RGB from the JPEG or PNG files of `folder`.

    Raises InputError if there is no such folder, it has fewer than 8, or one is incomplete.
    """
    get_some = "midastouch download ycb-slide backgrounds gets some"
    if len(paths := image_files(require_folder(folder, f"of no-contact images ({get_some})"))) < 8:
        raise InputError(
            f"{folder}: {len(paths)} no-contact images (PNG or JPEG), and at least 8 are needed ({get_some})"
        )
    images = [read_image_file(path) for path in paths]
    images = [cv2.resize(i, (width, height), interpolation=cv2.INTER_AREA)[:, :, ::-1] for i in images]
    return np.stack(images[:-HELD_OUT]), np.stack(images[-HELD_OUT:])


@dataclasses.dataclass(frozen=True)
class TrainingOptions:
    """Options of `train-tdn` and `train-tcn`.

    Attributes: meshes, folder of YCB scans; backgrounds, folder of no-contact images; colour_table, file of a real
    DIGIT's colours (Taxim) or None; out, folder for weights, log and checkpoint; minutes, time budget; steps, if given,
    number of steps after which the run ends instead, so that the seed makes it repeatable; workers, number of rendering
    processes; device, cpu or cuda; resume, folder of an earlier run to continue, or None; start, network to begin with
    (a shipped one by name, or an ONNX file), or None; light of the sensors that a depth network is trained for.
    """

    meshes: Path
    backgrounds: Path
    colour_table: Path | None
    out: Path
    minutes: float = 30.0
    steps: int | None = None
    seed: int = 0
    workers: int = 1
    device: str = "cpu"
    resume: Path | None = None
    start: str | None = None
    light: str = "additive"

    def network(self, kind: str) -> str:
        """Return the name of the network (of kind tdn or tcn) that is trained."""
        return f"{kind}_fast" if self.light == "additive" else f"{kind}_fast_{self.light}"

    def commands(self, network: str) -> list[str]:
        """Return the commands that made the weights of `network` (tdn or tcn), those of its start weights included."""
        bound = f"--steps {self.steps}" if self.steps else f"--minutes {self.minutes:g}"
        table = " --colour-table FILE" if self.colour_table else ""
        start = " --resume DIR" if self.resume else f" --start {Path(self.start).name}" if self.start else ""
        light = f" --light {self.light}" if self.light != "additive" else ""
        this = f"midastouch train-{network} {bound} --seed {self.seed}{light}{table}{start}"
        card = self.resume and self.resume / f"{self.network(network)}.json"
        if self.start and not self.resume:
            card = network_path(network, self.start).with_suffix(".json")
        return [*(json.loads(card.read_text()).get("commands", []) if card and card.is_file() else []), this]


@dataclasses.dataclass(frozen=True)
class TrainingData:
    """Attributes: meshes to train on, held_out to validate with; backgrounds and held_out_backgrounds
    (B, 160, 120, 3) uint8; ranges of the sensors' randomisation."""

    meshes: list[ObjectMesh]
    held_out: list[ObjectMesh]
    backgrounds: np.ndarray
    held_out_backgrounds: np.ndarray
    ranges: RandomisationRange

    @classmethod
    def load(cls, options: TrainingOptions) -> TrainingData:
        """Read the files that the options name. Raises InputError if the GPU, meshes, images or a valid table are
        missing."""
        if options.device == "cuda":
            import torch  # here: what else this module has needs none

            if not torch.cuda.is_available():
                raise InputError(
                    "--device cuda: PyTorch finds no GPU with CUDA here; without it, training is on the CPU"
                )
        table = ColourTable.load(options.colour_table) if options.colour_table else None
        sensor = SensorModel.load("digit_tacto").for_maps
        backgrounds = load_backgrounds(options.backgrounds, sensor.height, sensor.width)  # first: it is quick
        return cls(
            *load_objects(options.meshes, PROCEDURAL_OBJECTS, options.seed),
            *backgrounds,
            RandomisationRange(wide_fraction=_FAR_SENSORS, colour_table=table, design_fraction=_OTHER_DESIGNS),
        )
