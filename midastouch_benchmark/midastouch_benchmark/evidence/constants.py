"""Values of the constants in the code, by name: a change may matter where no probe of a fingerprint looks."""

from __future__ import annotations

import dataclasses
import importlib
import math
import pkgutil
import re
from collections.abc import Iterator, Mapping
from types import ModuleType
from typing import Any

import numpy as np

import midastouch_filter
import midastouch_perception
import midastouch_perception.sensor_calibration
import midastouch_perception.symmetry
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.presets import PRESETS

from ..trials.setup import Networks

_CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")
# modules for messages, trainings and calibrations, and those that only refuse images: they make no estimates
_ELSEWHERE = (
    *("nodes", "ros", "executables", "training", "train", "sensor_calibration", "official_weights", "network"),
    *("frame_guard", "fixed_pattern", "gel_view"),
)
_OF_ESTIMATES = ("grasp", "symmetry")  # no image, map or code depends on these
_OF_THE_MACHINE = ("threads",)
_ROUNDING = 1e-6  # of a number with the seven digits of a float
_ROUNDED_ZERO = 1e-12
Constants = dict[str, list[float | str]]


def of_perception(networks: Networks) -> Constants:
    """Return the constants of images, maps, codes and codebooks, and the ids of networks and sensor."""
    ids = networks.describe() | {"sensor": networks.sensor.content_id}
    found = _of_package(midastouch_perception, (*_ELSEWHERE, *_OF_ESTIMATES))
    return found | {name: [value] for name, value in ids.items()}


def of_calibration() -> Constants:
    """Return the constants of calibrations of sensors."""
    return _of_package(midastouch_perception.sensor_calibration, elsewhere=())


def of_filter() -> Constants:
    """Return the constants of the filter, with its settings and those of the presets."""
    config = FilterConfig()
    fields = [dataclasses.asdict(each) for each in (config, NoiseModel.of(config))]
    out = _of_package(midastouch_perception.symmetry) | _of_package(midastouch_filter)
    for name, value in [*_flat({"preset": PRESETS}), *(pair for each in fields for pair in _flat(each))]:
        if name not in _OF_THE_MACHINE:
            out.setdefault(name, []).append(value)
    return out


def changed(one: Mapping[str, list], other: Mapping[str, list]) -> list[str]:
    """Return the names of constants with other values. A name on one side only was renamed, added or removed: the
    probes show whether that matters. Modules may have a name in common, so a value more or less does not count as
    another value. Computed values may differ by rounding: another machine's pseudoinverse has other zeros."""
    differ = ((name, one[name], other[name]) for name in sorted(one.keys() & other.keys()))
    return [name for name, here, there in differ if not (_among(here, there) or _among(there, here))]


def _among(some: list[float | str], others: list[float | str]) -> bool:
    return all(any(_same(each, other) for other in others) for each in some)


def _same(one: float | str, other: float | str) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return math.isclose(one, other, rel_tol=_ROUNDING, abs_tol=_ROUNDED_ZERO)


def _of_package(package: ModuleType, elsewhere: tuple[str, ...] = _ELSEWHERE) -> Constants:
    """Return the constants of all modules of a package except those in `elsewhere`; constants that have a name in
    common give a sorted list of values, each once."""
    found: dict[str, set[float]] = {}
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if set(info.name.split(".")) & set(elsewhere):
            continue
        for name, value in vars(importlib.import_module(info.name)).items():
            if _CONSTANT.fullmatch(name):
                for key, number in _flat({name: value}):
                    found.setdefault(key, set()).add(number)
    return {name: sorted(values) for name, values in sorted(found.items())}


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers in a nested value, each with its path."""
    if isinstance(value, (bool, int, float, np.number)):
        yield name, float(f"{float(value):.9g}")
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from _flat(each, f"{name}.{key}".strip("."))
    elif isinstance(value, (tuple, list, np.ndarray)):
        for k, each in enumerate(value):
            yield from _flat(each, f"{name}.{k}")
