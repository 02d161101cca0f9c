"""What every evaluation starts from: networks, background of a sequence, filter settings from a file."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np

from midastouch_filter.config import FilterConfig
from midastouch_filter.presets import BALANCED, preset
from midastouch_perception.errors import InputError
from midastouch_perception.files import read_yaml
from midastouch_perception.pipeline import TouchPipeline
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tcn import TactileCodeNet, load_tcn
from midastouch_perception.tdn import DepthNet, estimate_background, load_tdn

from ..datasets import Sequence
from ..processes.parameter_files import read_parameters

_BACKGROUND_FRAMES = 60


@dataclasses.dataclass(frozen=True)
class Networks:
    """Both networks and the sensor they are used with."""

    tdn: DepthNet
    tcn: TactileCodeNet
    sensor: SensorModel

    @classmethod
    def load(
        cls, tdn: str = "fast", tcn: str = "fast", sensor: str = "digit_tacto", light: str | None = None
    ) -> Networks:
        """By name or file; light: as `SensorModel.light`, the model's own by default. InputError for what is not
        there."""
        model = SensorModel.load(sensor)
        model = dataclasses.replace(model, light=light or model.light)
        return cls(load_tdn(tdn, model), load_tcn(tcn, model), model)

    def pipeline(self) -> TouchPipeline:
        """A pipeline without memory of earlier frames."""
        return TouchPipeline(self.tdn, self.tcn, time.perf_counter)

    def describe(self) -> dict[str, str]:
        """Ids for the JSON files."""
        return {"tdn": self.tdn.network_id, "tcn": self.tcn.network_id, "sensor": self.sensor.name}


def sequence_background(sequence: Sequence) -> tuple[np.ndarray, str]:
    """The sensor's no-contact image (320, 240, 3) uint8 for a sequence, and where it comes from."""
    stored = sequence.background
    if stored is not None:
        return stored, sequence.background_path.name
    chosen = np.unique(np.linspace(0, sequence.n_frames - 1, _BACKGROUND_FRAMES).round().astype(int))
    return estimate_background([sequence.image(int(i)) for i in chosen]), f"estimated from {len(chosen)} frames"


def load_filter_config(path: str | None, preset_name: str | None = None) -> FilterConfig:
    """Filter settings from a YAML file, plain `name: value` lines or a ROS parameter file.

    What the file does not set is as in a preset: the one named, or else the file's. In a ROS parameter file the entries
    of `particle_filter` count; those that concern only the node (topics, frames, files) are passed over. Raises
    InputError on unknown names and values out of range.
    """
    settings = preset(preset_name or BALANCED)
    if path is None:
        return FilterConfig(**settings)
    content = read_yaml(path, "configuration") or {}
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds no settings; give `name: value` lines or a ROS parameter file")
    known = {"preset", *(item.name for item in dataclasses.fields(FilterConfig))}
    values = content
    if any(isinstance(value, dict) for value in content.values()):
        values = read_parameters(path).get("particle_filter", {})
        values = {name: value for name, value in values.items() if name in known}
    if unknown := sorted(set(map(str, values)) - known):
        raise InputError(f"{path}: unknown filter settings: {', '.join(unknown)}; check the spelling")
    try:
        of_file = preset(values.pop("preset", BALANCED))
        return FilterConfig(**((settings if preset_name else of_file) | values))
    except InputError as error:
        raise InputError(f"{Path(path)}: {error}") from error
