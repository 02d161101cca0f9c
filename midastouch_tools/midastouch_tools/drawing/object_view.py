"""Pictures of one object from one side: particles with modes and truth, likelihood of a touch, paths."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property

import numpy as np
from matplotlib import colormaps
from scipy.spatial import cKDTree

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import pose_errors
from midastouch_perception.codebook import Codebook
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_model import SensorModel

from ..bags.run_record import Snapshot
from .canvas import Camera, Canvas, best_direction

_NEIGHBOURS = 12


class PositionBlend:
    """Interpolation from places (C, 3) m to surface points (P, 3) m: each point blends its nearest places.

    Neighbours and weights are found once, and serve any number of values.
    """

    def __init__(self, places: np.ndarray, points: np.ndarray):
        # without `workers`: after Ctrl-C those go on with arrays that are gone, and end the process (SIGSEGV)
        distance, index = cKDTree(places).query(points, min(_NEIGHBOURS, len(places)))
        self._index = index.reshape(len(points), -1)
        distance = distance.reshape(len(points), -1)
        weight = np.exp(-4 * (distance / np.maximum(distance[:, -1:], 1e-9)) ** 2)
        self._weight = weight / weight.sum(axis=1, keepdims=True)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return values (P, ...) at the points from those (C, ...) at the places."""
        return np.einsum("pk,pk...->p...", self._weight, values[self._index])


ANGLE_COLOURS = colormaps["turbo"]
HEAT_COLOURS = colormaps["YlOrRd"]
TRUTH_COLOUR = np.array([0.05, 0.55, 0.25])
ESTIMATE_COLOUR = np.array([0.80, 0.10, 0.45])
_CONTACT_COLOUR = np.array([0.95, 0.55, 0.10])
_CONTACT_RADIUS = 8e-5  # m, of a measured point: together they cover the contact
_LIFT = 0.02  # m towards the viewer, in front of the surface
_CELL = 0.003  # m; entries in one cell count as one place
Colouring = Callable[[np.ndarray], np.ndarray]
"""Blended values (P, ...) to RGB (P, 3) in [0, 1]."""


def measured_contact(snapshot: Snapshot, sensor: SensorModel) -> np.ndarray:
    """Return the measured points (K, 3) m in the object's frame, placed by the published pose; none without one.
    InputError for a penetration map of another shape than the sensor's."""
    pose, penetration = snapshot.estimate, snapshot.penetration
    if pose is None or penetration is None:
        return np.empty((0, 3))
    sensor = sensor.scaled(len(penetration) / sensor.height)
    if penetration.shape != (sensor.height, sensor.width):
        raise InputError(f"penetration maps of {penetration.shape} are not of {sensor.name}; give --sensor")
    return cloud_from_penetration(penetration, penetration > 0, sensor) @ pose[:3, :3].T + pose[:3, 3]


class ObjectView:
    """Pictures of the mesh, `width` px wide, from the side that the poses `T_obj_gel` (N, 4, 4) touch.

    Later poses have more weight in the choice of the side, so that the end of a run is in sight.
    """

    def __init__(self, mesh: ObjectMesh, poses: np.ndarray, width: int):
        self.mesh = mesh
        outward = np.asarray(poses)[:, :3, 2]
        direction = best_direction(outward, np.linspace(0.3, 1.0, len(outward)))
        tips = poses[:, :3, 3:] + self._axis_length * poses[:, :3, :3]
        shown = np.concatenate([mesh.vertices[mesh.faces].reshape(-1, 3), np.swapaxes(tips, 1, 2).reshape(-1, 3)])
        up = _up(mesh, direction)
        spread = np.ptp(_spread(shown, direction, up), axis=0)
        height = int(width * np.clip(1.06 * spread[1] / spread[0], 0.4, 0.9))
        self.camera = Camera.around(shown, direction, up, width, height)
        self._field: _LikelihoodField | None = None

    @cached_property
    def _bare(self) -> Canvas:
        canvas = Canvas(self.camera)
        canvas.draw_mesh(self.mesh)
        return canvas

    @property
    def _axis_length(self) -> float:
        return 0.11 * self.mesh.diagonal

    def particles(self, snapshot: Snapshot) -> np.ndarray:
        """Draw particles coloured by their angle to the truth (blue 0, red 180 deg), modes as axes with their
        2-sigma ellipse, the truth as a green point with large axes; (H, W, 3) uint8."""
        canvas = self._bare.copy()
        angle = pose_errors(snapshot.particles, snapshot.truth)[1]
        canvas.draw_points(snapshot.particles[:, :3, 3], ANGLE_COLOURS(0.1 + 0.8 * angle / np.pi)[:, :3], radius=3.0)
        for mode in snapshot.modes[:6]:
            canvas.draw_axes(mode.pose, 0.55 * self._axis_length, radius=1.3)
            canvas.draw_ellipse(mode.pose[:3, 3], mode.covariance[:3, :3], np.full(3, 0.15))
        canvas.draw_points(snapshot.truth[None, :3, 3], TRUTH_COLOUR, radius=6.0, hidden_alpha=0.5)
        canvas.draw_axes(snapshot.truth, self._axis_length, halo=True)
        return canvas.image()

    def close_up(self, snapshot: Snapshot, contact: np.ndarray, times: int) -> tuple[np.ndarray, Camera]:
        """Draw the truth (green) and the published pose as crosses along the gel's x and y, and `contact` (K, 3) m, at
        `times` the size; return the picture (H, H, 3) uint8 and its camera."""
        size, centre, pixel = self.camera.height, snapshot.truth[:3, 3], self.camera.pixel_size / times
        camera = dataclasses.replace(self.camera, centre=centre, pixel_size=pixel, width=size)
        canvas = Canvas(camera)
        canvas.draw_mesh(self.mesh)
        canvas.draw_points(contact, _CONTACT_COLOUR, _CONTACT_RADIUS / pixel, alpha=0.3, hidden_alpha=0.3)
        for pose, colour, radius in ((snapshot.truth, TRUTH_COLOUR, 3.5), (snapshot.estimate, ESTIMATE_COLOUR, 1.2)):
            if pose is not None:
                arms = 0.3 * size * pixel * pose[:3, :2].T
                middle = pose[:3, 3] + _LIFT * camera.rotation[2]
                canvas.draw_lines(middle - arms, middle + arms, colour, radius, hidden_alpha=0)
        return canvas.image(), camera

    def likelihood(self, codebook: Codebook, snapshot: Snapshot) -> np.ndarray:
        """Colour points by how well a touch there would match, pale to red, and draw the truth; (H, W, 3) uint8."""
        canvas = self._bare.copy()
        if snapshot.code is not None:
            if self._field is None or self._field.codebook is not codebook:
                self._field = _LikelihoodField(codebook, canvas.surface_points())
            canvas.paint(self._field.colours(snapshot.code))
        canvas.draw_axes(snapshot.truth, self._axis_length, halo=True)
        return canvas.image()

    def painted(self, places: np.ndarray, outward: np.ndarray, values: np.ndarray, colouring: Colouring) -> np.ndarray:
        """Draw the surface in the `colouring` of values (C, ...) known at places (C, 3) m; (H, W, 3) uint8.

        Only places whose normal `outward` (C, 3) faces the viewer count: the far side of a thin part is as near as its
        own surroundings.
        """
        canvas = self._bare.copy()
        facing = outward @ self.camera.rotation[2] > 0
        canvas.paint(colouring(PositionBlend(places[facing], canvas.surface_points())(values[facing])))
        return canvas.image()

    def paths(self, truth: np.ndarray, estimates: list[np.ndarray]) -> np.ndarray:
        """Draw the true path (N, 4, 4) in green and estimated ones in red; (H, W, 3) uint8."""
        canvas = self._bare.copy()
        for path in estimates:
            canvas.draw_points(path[:, :3, 3], ESTIMATE_COLOUR, radius=1.8, alpha=0.6)
        canvas.draw_lines(truth[:-1, :3, 3], truth[1:, :3, 3], TRUTH_COLOUR, radius=1.4)
        canvas.draw_axes(truth[-1], 0.4 * self._axis_length, halo=True)
        return canvas.image()


def _up(mesh: ObjectMesh, direction: np.ndarray) -> np.ndarray:
    """The picture's up direction: the object's z axis, unless the object would then stand taller than
    wide."""
    seen = [np.ptp(_spread(mesh.vertices, direction, up), axis=0) for up in np.eye(3)[[2, 0]]]
    lying = seen[1][0] / seen[1][1] > 1.5 * seen[0][0] / seen[0][1]
    return np.eye(3)[0 if lying else 2]


def _spread(points: np.ndarray, direction: np.ndarray, up: np.ndarray) -> np.ndarray:
    return points @ Camera.around(points, direction, up, 1, 1).rotation[:2].T


class _LikelihoodField:
    """Similarity of a touch to the codebook's entries as colours of surface points (P, 3) m.

    Among the entries at one place, which differ in yaw and press, the most similar one counts, as a touch may come
    with any. Points blend the nearest places, which do not depend on the touch and are found once.
    """

    def __init__(self, codebook: Codebook, points: np.ndarray):
        self.codebook = codebook
        positions = codebook.poses[:, :3, 3]
        cells, self._place = np.unique(np.round(positions / _CELL), axis=0, return_inverse=True)
        self._blend = PositionBlend(cells * _CELL, points)

    def colours(self, code: np.ndarray) -> np.ndarray:
        """Return RGB (P, 3) for a code (D,): square root of the calibrated likelihood, relative to the best place's.

        The root widens the range that the eye can distinguish.
        """
        best = np.full(self._place.max() + 1, -np.inf)
        np.maximum.at(best, self._place.ravel(), self.codebook.codes @ code)
        heat = np.exp((best - best.max()) / (2 * self.codebook.meta["temperature"]))
        return HEAT_COLOURS(self._blend(heat))[:, :3]
