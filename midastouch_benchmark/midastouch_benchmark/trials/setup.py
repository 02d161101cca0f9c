"""Inputs of every evaluation: networks, background of a sequence, filter settings from a file."""

from __future__ import annotations

import dataclasses
import difflib
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from midastouch_bringup.parameter_files import of_node, read_parameters
from midastouch_common.errors import InputError
from midastouch_common.files import read_yaml
from midastouch_filter.core.config import FilterConfig, by_present_names
from midastouch_filter.core.presets import BALANCED, PAPER, preset
from midastouch_perception.pipeline import TouchPipeline
from midastouch_perception.sensor_calibration.calibration import SensorCalibration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import AnyCodeNet, load_tcn
from midastouch_perception.tdn import DepthNet, estimate_background, load_tdn
from midastouch_perception.tdn.background import MOST_DOUBTFUL, doubtful_fraction
from midastouch_tools.datasets import Sequence

_BACKGROUND_FRAMES = 60
_ALIKE = 0.8  # similarity of two names; no other parameter of the node is as similar to a setting's


@dataclasses.dataclass(frozen=True)
class Networks:
    """Both networks and the sensor they are used with."""

    tdn: DepthNet
    tcn: AnyCodeNet
    sensor: SensorModel

    @classmethod
    def load(
        cls,
        tdn: str = "fast",
        tcn: str = "fast",
        sensor: str = "digit_tacto",
        light: str | None = None,
        calibration: str | None = None,
    ) -> Networks:
        """Load by name or file; light: as `SensorModel.light`, the model's own by default; calibration: a file of the
        very sensor, or None. InputError for a file that is missing, or of another sensor model."""
        model = SensorModel.load(sensor)
        model = dataclasses.replace(model, light=light or model.light)
        known = SensorCalibration.load(calibration) if calibration else None
        return cls(load_tdn(tdn, model, known), load_tcn(tcn, model), model)

    def pipeline(self) -> TouchPipeline:
        """Return a pipeline without memory of earlier frames."""
        return TouchPipeline(self.tdn, self.tcn, time.perf_counter)

    def describe(self) -> dict[str, str]:
        """Return the ids of networks, sensor and sensor calibration, for result files."""
        ids = {"tdn": self.tdn.network_id, "tcn": self.tcn.network_id, "sensor": self.sensor.name}
        known = self.tdn.calibration
        return ids if known is None else ids | {"calibration": f"{known.touched}, {known.date}"}


@dataclasses.dataclass(frozen=True)
class Untouched:
    """A sequence's no-contact image (320, 240, 3) uint8 RGB; source: its origin; doubt: why it may show contacts, and
    the fix, empty without a doubt."""

    image: np.ndarray
    source: str
    doubt: str = ""


def untouched_of(sequence: Sequence, given: str | None = None) -> Untouched:
    """Return the no-contact image in the file `given`; without it, the sequence's own; without both, an estimate.

    The estimate is made from the sequence's images. Raises InputError if the file cannot be read.
    """
    if given:
        return Untouched(sequence.read_background(Path(given)), given)
    stored = sequence.background
    if stored is not None:
        return Untouched(stored, sequence.background_path.name)
    chosen = np.unique(np.linspace(0, sequence.n_frames - 1, _BACKGROUND_FRAMES).round().astype(int))
    images = [sequence.image(int(i)) for i in chosen]
    estimated, doubt = estimate_background(images), ""
    if sequence.layout == "tactile_tracking" or doubtful_fraction(images, estimated) > MOST_DOUBTFUL:
        # trials of TactileTracking are in contact from the first image to the last
        doubt = (
            f"{sequence.path}: the no-contact image is estimated, but the images do not show all of the gel untouched; "
            "give the sensor's with --background, or put it there as background.png"
        )
    return Untouched(estimated, f"estimated from {len(chosen)} frames", doubt)


def require_same_gel(tdn: DepthNet, untouched: Iterable[Untouched]) -> None:
    """Raise InputError if the network's calibration is of another gel than one of these no-contact images."""
    for each in untouched:
        if tdn.calibration is not None and (problem := tdn.calibration.background_problem(each.image)):
            raise InputError(f"{each.source}: {problem}")


def sensor_of(sequences: Iterable[Sequence]) -> str:
    """Return the name of the sensor model that sequences were recorded with; InputError if they differ in it."""
    names = sorted({sequence.sensor for sequence in sequences})
    if len(names) > 1:
        raise InputError(f"sequences of different sensors ({', '.join(names)}); evaluate them apart, or give --sensor")
    return names[0]


def load_filter_config(path: str | None, preset_name: str | None = None) -> FilterConfig:
    """Return filter settings from a YAML file, plain `name: value` lines or a ROS parameter file.

    Settings that the file lacks are those of a preset: the one named or, without it, the file's. In a ROS parameter
    file the entries of `particle_filter`, in any namespace, and of every node count; those that concern only the node
    (topics, frames, files) are skipped. Raises InputError for values out of range and for unknown names; in a ROS
    parameter file, only for unknown names that resemble a setting's. Former names of settings count, with a
    FutureWarning.
    """
    settings = _settings(preset_name or BALANCED)
    if path is None:
        return FilterConfig(**settings)
    content = read_yaml(path, "configuration") or {}
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds no settings; give `name: value` lines or a ROS parameter file")
    known = {"preset", *(item.name for item in dataclasses.fields(FilterConfig))}
    of_nodes = any(isinstance(value, dict) for value in content.values())
    try:
        values = by_present_names(of_node(read_parameters(path), "particle_filter") if of_nodes else content)
        unknown = sorted(set(map(str, values)) - known)
        if of_nodes:
            unknown = [name for name in unknown if difflib.get_close_matches(name, known, n=1, cutoff=_ALIKE)]
            values = {name: value for name, value in values.items() if name in known}
        if unknown:
            raise InputError(f"unknown filter settings: {', '.join(unknown)}; check the spelling")
        of_file = _settings(values.pop("preset", BALANCED))
        return FilterConfig(**((settings if preset_name else of_file) | values))
    except InputError as error:
        raise InputError(f"{Path(path)}: {error}") from error


def _settings(name: str) -> dict[str, Any]:
    if name == PAPER:
        raise InputError(f"preset {PAPER} is another filter; `midastouch benchmark --variant {PAPER}` measures it")
    return preset(name)
