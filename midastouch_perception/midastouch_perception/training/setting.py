"""What a training run is given: its options, and the data they name."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh

from ..onnx_network import network_path
from ..sensor_model import SensorModel
from ..simulation.colour_table import ColourTable
from ..simulation.randomisation import RandomisationRange
from .backgrounds import load_backgrounds
from .objects import load_objects

PROCEDURAL_OBJECTS = 24
_OTHER_DESIGNS = 0.2  # of the sensors with relative light: a new gel is to be read before anybody trains for it


@dataclasses.dataclass(frozen=True)
class TrainingOptions:
    """Options of `train-tdn` and `train-tcn`.

    Attributes: meshes, folder of YCB scans; backgrounds, folder of no-contact images; colour_table, file of a real
    DIGIT's colours (Taxim) or None; out, folder for weights, log and checkpoint; minutes, time budget; steps, if given
    the run ends after as many steps instead, and is repeatable with its seed; workers, rendering processes; device,
    cpu or cuda; resume, folder of an earlier run to go on from, or None; start, network to begin with (a shipped one
    by name, or an ONNX file), or None; light of the sensors that a depth network is trained for (`SensorModel`).
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
        """Name of the network (of kind tdn or tcn) that is trained."""
        return f"{kind}_fast" if self.light == "additive" else f"{kind}_fast_{self.light}"

    def commands(self, network: str) -> list[str]:
        """Every command that shaped the weights of `network` (tdn or tcn): those of the run resumed, and this one."""
        bound = f"--steps {self.steps}" if self.steps else f"--minutes {self.minutes:g}"
        table = " --colour-table FILE" if self.colour_table else ""
        start = " --resume DIR" if self.resume else f" --start {Path(self.start).name}" if self.start else ""
        light = f" --light {self.light}" if self.light != "additive" else ""
        this = f"midastouch train-{network} {bound} --seed {self.seed}{light}{table}{start}"
        card = self.resume and self.resume / f"{self.network(network)}.json"
        if self.start and not self.resume:
            card = network_path(network, self.start).with_suffix(".json")
        return [*(json.loads(card.read_text())["commands"] if card and card.is_file() else []), this]


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
        """Read what the options name. Raises InputError for folders without meshes or images, or a bad table."""
        table = ColourTable.load(options.colour_table) if options.colour_table else None
        sensor = SensorModel.load("digit_tacto").for_maps
        return cls(
            *load_objects(options.meshes, PROCEDURAL_OBJECTS, options.seed),
            *load_backgrounds(options.backgrounds, sensor.height, sensor.width),
            RandomisationRange(colour_table=table, design_share=_OTHER_DESIGNS),
        )
