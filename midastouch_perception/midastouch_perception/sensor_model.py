"""Geometry of one kind of tactile sensor: camera and undeformed gel, read from a YAML file.

Frames (docs/interfaces.md): the gel frame has its origin at the apex of the undeformed gel and z from object to
camera; the camera sits `gel_distance` up that axis and looks along -z. Pixels exist only here.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import expanded, read_yaml

MAP_SCALE = 0.5
"""Resolution of penetration maps, which is that of the depth network, as a fraction of the image's."""

MAX_PENETRATION = 2e-3
"""Deepest press [m] on which the networks are trained: images of a deeper one read as a shallower one."""

LIGHTS = ("relative", "additive")
DIGIT_LAMPS = "digit"
_LAMPS = "", DIGIT_LAMPS, "gelsight_mini"
_IMAGE = 240, 320  # px, of all networks
_KEYS = "width", "height", "focal", "gel_distance", "dome", "light", "lamps"
_DOME = {"radius_x", "radius_y", "semi_axis_z"}
_PIXEL = 0.005e-3, 0.5e-3  # m: from a microscope's to a finger's
_SCALES = 0.2, 5  # of one sensor's pixels per metre to the model's
_FOLDER = Path(__file__).parent / "sensor_models"


@dataclasses.dataclass(frozen=True)
class SensorModel:
    """Pin-hole camera behind a domed gel.

    Attributes: name; width, height [px]; focal [px]; gel_distance [m], camera to gel apex; dome, the parameters of
    `sag`. light, the effect of a contact on the image: `relative`, by a fraction of each colour without contact (real
    gel under its own lights), or `additive`, by grey levels for any no-contact image (a simulator that adds rendered
    differences to a photograph). lamps, the kind of sensor whose colours come from the same sides, also in a copy of
    its model: `digit`, whose images show whether they are turned, or `gelsight_mini`, whose calibration is used if the
    sensor has none of its own; otherwise empty.
    """

    name: str
    width: int
    height: int
    focal: float
    gel_distance: float
    dome: tuple[tuple[str, float], ...]
    light: str = "relative"
    lamps: str = ""

    @classmethod
    def load(cls, name_or_path: str | Path) -> SensorModel:
        """Load a sensor model.

        Parameters
        ----------
        name_or_path
            A shipped model (`digit_tacto`, `digit_real`, `gelsight_mini`), or a YAML file of the same form.

        Returns
        -------
        SensorModel
            At image resolution, 240 x 320 pixels.

        Raises
        ------
        InputError
            No such model, or a value of the file that cannot be used.
        """
        path = _FOLDER / f"{name_or_path}.yaml"
        if not path.is_file():
            path = expanded(name_or_path, "sensor_model")
            if path.suffix != ".yaml":
                known = ", ".join(sorted(p.stem for p in _FOLDER.glob("*.yaml")))
                raise InputError(f"sensor model '{name_or_path}' is not known; use {known} or a .yaml file")
        data = read_yaml(path, "sensor model")
        try:
            if unknown := sorted(set(data) - set(_KEYS)):
                raise ValueError(f"unknown: {', '.join(map(str, unknown))}; there are {', '.join(_KEYS)}")
            model = cls(
                name=path.stem,
                width=_whole(data["width"]),
                height=_whole(data["height"]),
                focal=float(data["focal"]),
                gel_distance=float(data["gel_distance"]),
                dome=tuple(sorted((str(k), float(v)) for k, v in data["dome"].items())),
                light=str(data.get("light", "relative")),
                lamps=str(data.get("lamps", "")),
            )
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise InputError(f"{path}: not a sensor model ({error}); compare with digit_tacto.yaml") from error
        if set(dict(model.dome)) != _DOME:
            raise InputError(f"{path}: dome needs radius_x, radius_y and semi_axis_z")
        lengths = (model.width, model.height, model.focal, model.gel_distance, *dict(model.dome).values())
        if not all(0 < length < math.inf for length in lengths):
            raise InputError(f"{path}: width, height, focal, gel_distance and those of dome must be positive numbers")
        if (model.width, model.height) != _IMAGE:
            raise InputError(
                f"{path}: {model.width} x {model.height} px, but the networks take {_IMAGE[0]} x {_IMAGE[1]}: let the "
                "driver's camera_model scale its output to that, and give focal for it"
            )
        if model.light not in LIGHTS:
            raise InputError(f"{path}: light '{model.light}' is not known; use {' or '.join(LIGHTS)}")
        if model.lamps not in _LAMPS:
            known = " or ".join(filter(None, _LAMPS))
            raise InputError(f"{path}: lamps '{model.lamps}' are not known; use {known}, or leave the line out")
        if not _PIXEL[0] < model.pixel_size < _PIXEL[1]:
            raise InputError(
                f"{path}: a pixel of {1e3 * model.pixel_size:.3g} mm (gel_distance over focal) is not a tactile "
                "sensor's; give focal in pixels and gel_distance in metres"
            )
        return model

    def as_json(self) -> dict:
        """Return the whole model, for a codebook's description."""
        return dataclasses.asdict(self) | {"dome": [list(pair) for pair in self.dome]}

    @classmethod
    def of_codebook(cls, meta: Mapping) -> SensorModel:
        """Return the model in a codebook's description; if that only names it, the shipped one."""
        stored = meta.get("sensor_model")
        if stored is None:
            return cls.load(meta["sensor"])
        try:
            return cls(**{**stored, "dome": tuple((str(k), float(v)) for k, v in stored["dome"])})
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"codebook: not a sensor model in it ({error!r}); build it again") from error

    @cached_property
    def content_id(self) -> str:
        """Short hash of the geometry, recorded in codebooks and weights; a codebook does not depend on the light."""
        values = dataclasses.asdict(self)
        del values["light"], values["lamps"]
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]

    def scaled(self, factor: float) -> SensorModel:
        """Return the same sensor with `factor` times as many pixels along each side."""
        return dataclasses.replace(
            self, width=round(self.width * factor), height=round(self.height * factor), focal=self.focal * factor
        )

    def at_scale(self, pixels_per_metre: float) -> SensorModel:
        """Return the model of the same gel at a scale in pixels per metre at its apex (measure it with a ruler).

        Raises InputError for a scale that differs from the model's by more than a factor of five.
        """
        factor = pixels_per_metre * self.pixel_size
        if not _SCALES[0] <= factor <= _SCALES[1]:
            raise InputError(
                f"{1e-3 * pixels_per_metre:g} px/mm, {factor:.3g} times those of {self.name}: give pixels per "
                "millimetre; a DIGIT has 17 to 21"
            )
        return dataclasses.replace(self, focal=pixels_per_metre * self.gel_distance)

    @cached_property
    def for_maps(self) -> SensorModel:
        """Model of the same sensor at the resolution of penetration maps."""
        return self.scaled(MAP_SCALE)

    def sag(self, x: float | np.ndarray, y: float | np.ndarray) -> np.ndarray:
        """Return how far the gel falls off towards the camera.

        The gel is the cap of an ellipsoid: radii of curvature at the apex along x and y, semi-axis along z.

        Parameters
        ----------
        x, y : [m] from the apex

        Returns
        -------
        [m], in the shape of x and y
        """
        dome = dict(self.dome)
        c = dome["semi_axis_z"]
        inside = 1.0 - x**2 / (c * dome["radius_x"]) - y**2 / (c * dome["radius_y"])
        return c * (1.0 - np.sqrt(np.maximum(inside, 0.0)))

    @cached_property
    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Tangents (x/depth, y/depth), each (H, W) float64, of the rays through the pixel centres; y up."""
        u = (np.arange(self.width) + 0.5 - self.width / 2) / self.focal
        v = -(np.arange(self.height) + 0.5 - self.height / 2) / self.focal
        return np.tile(u, (self.height, 1)), np.tile(v[:, None], (1, self.width))

    @cached_property
    def gel_depth(self) -> np.ndarray:
        """Depth (H, W) float64 [m] of the undeformed gel along the camera axis, seen through each pixel."""
        return self._depth_along(*self.rays)

    def gel_points(self, pixels: np.ndarray) -> np.ndarray:
        """Return points (N, 3) m of the undeformed gel, gel frame, seen at (N, 2) pixel coordinates (column, row).

        The centre of the first pixel is (0.5, 0.5); pixels may lie beyond the image.
        """
        u, v = np.asarray(pixels, float).T
        tangent_x, tangent_y = (u - self.width / 2) / self.focal, (self.height / 2 - v) / self.focal
        depth = self._depth_along(tangent_x, tangent_y)
        return np.column_stack([tangent_x * depth, tangent_y * depth, self.gel_distance - depth])

    def _depth_along(self, tangent_x: np.ndarray, tangent_y: np.ndarray) -> np.ndarray:
        depth = np.full(np.shape(tangent_x), self.gel_distance)
        # contraction: the sag's slope times the ray's tangent is below 0.3 everywhere in view
        for _ in range(60):
            depth = self.gel_distance - self.sag(depth * tangent_x, depth * tangent_y)
        return depth

    @property
    def pixel_size(self) -> float:
        """Edge [m] of one pixel at the gel apex."""
        return self.gel_distance / self.focal

    @property
    def pixel_area(self) -> float:
        """Area [m^2] of one pixel at the gel apex."""
        return self.pixel_size**2


def given_as(name: str) -> str:
    """Return the argument that selects the model of this name: the name if it is shipped, otherwise its file."""
    file = f"{name}.yaml"
    return name if (_FOLDER / file).is_file() else file


def _whole(value: float) -> int:
    if value != int(value):
        raise ValueError(f"{value} is not a whole number of pixels")
    return int(value)
