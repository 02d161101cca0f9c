"""Renderer of penetration maps of a mesh pressed into the gel, for batches of contact poses.

It is a z-buffer over only the triangles under the sensor's footprint, rasterised in homogeneous coordinates (Olano and
Greer 1997): no clipping is needed, and the depth at a pixel centre is exact. Back faces are culled, as in TACTO.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

import midastouch_kernels as kernels
from midastouch_common.mesh import ObjectMesh

from ..sensor_model import SensorModel

_STEEPEST = 0.7  # slope with which the gel leaves an object


def sunk_in(penetration: np.ndarray, pixel: float, reach: float, fraction: float) -> np.ndarray:
    """Return the height (H, W) float32 m of a gel that a contact draws in around itself, as a membrane does.

    Where an object touches, the gel has its shape; outside, the slope at the outline decays over `reach` m. So the gel
    moves further than the contact penetrates, and over a larger area.

    Args: penetration (H, W) m, of the contact; pixel, m per pixel; fraction (0 ... 1), slope with which the gel leaves
    the object relative to that of the outline: 0 if the gel ends at the outline, 1 if it has no edge there.
    """
    touched = (penetration > 0).astype(np.uint8)
    rim = (touched > 0) & (cv2.erode(touched, np.ones((3, 3), np.uint8)) == 0)
    if touched.all() or not rim.any():
        return penetration
    slope_x, slope_y = cv2.Sobel(penetration, cv2.CV_32F, 1, 0), cv2.Sobel(penetration, cv2.CV_32F, 0, 1)
    steep = float(np.median(np.hypot(slope_x[rim], slope_y[rim]))) / (8 * pixel)
    depth = fraction * reach * min(steep, _STEEPEST)
    distance = cv2.distanceTransform(1 - touched, cv2.DIST_L2, 5) * np.float32(pixel)
    return penetration + np.float32(depth) * np.exp(-distance / np.float32(reach))


@dataclasses.dataclass(frozen=True)
class GelShape:
    """Response of a gel to the shape pressed into it: reach [m] and fraction as in `sunk_in`, and blur [m]."""

    reach: float
    fraction: float
    blur: float

    def height(self, penetration: np.ndarray, pixel: float) -> np.ndarray:
        """Return the gel's height (H, W) float32 m over its rest for a penetration map (H, W) m; pixel, m per pixel."""
        return cv2.GaussianBlur(sunk_in(penetration, pixel, self.reach, self.fraction), (0, 0), self.blur / pixel)


class PenetrationRenderer:
    """Renderer of penetration maps of one mesh for one sensor model.

    The attribute `scene` is object and sensor in the form that the kernels take.

    Parameters
    ----------
    mesh
    sensor
        Its width x height is the size of the maps (see `SensorModel.scaled`).
    margin
        Surface that lies up to this far [m] beyond the undeformed gel is seen, too, as negative penetration down to
        -margin. Pose alignment needs it to know which surface is about to touch.
    """

    def __init__(self, mesh: ObjectMesh, sensor: SensorModel, margin: float = 0.0):
        self.mesh, self.sensor, self.margin = mesh, sensor, margin
        cell = float(np.clip(mesh.diagonal / 40, 2e-3, 8e-3))
        gel_depth = np.ascontiguousarray(sensor.gel_depth + margin, np.float32)
        grid = kernels.TriangleGrid(mesh.vertices[mesh.faces], cell)
        self.scene = kernels.Scene(grid, gel_depth, sensor.focal, sensor.gel_distance, margin)

    def render(self, poses: np.ndarray) -> np.ndarray:
        """Render penetration maps.

        Parameters
        ----------
        poses : gel poses `T_obj_gel` (N, 4, 4)

        Returns
        -------
        (N, H, W) float32
            Penetration [m]: the undeformed gel's depth minus the surface's along the camera axis; -margin, by default
            0, where no surface is seen.
        """
        penetration = self._rasterise(poses, False)[0]
        if self.margin:
            penetration -= np.float32(self.margin)
        return penetration

    def render_with_normals(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Render penetration (N, H, W) float32 [m] and smooth-shaded normals (N, H, W, 3) float32 in the gel frame.

        Normals are interpolated over each face from `ObjectMesh.corner_normals`; without contact they are 0.
        """
        poses = np.ascontiguousarray(poses, float)
        penetration, faces = self._rasterise(poses, True)
        tangent_x, tangent_y = self.sensor.rays
        normals = kernels.interpolate_normals(self.scene, poses, faces, self.mesh.corner_normals, tangent_x, tangent_y)
        return penetration, normals

    def _rasterise(self, poses: np.ndarray, with_faces: bool) -> tuple[np.ndarray, np.ndarray]:
        poses = np.ascontiguousarray(poses, float)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4):
            raise ValueError(f"poses must be (N, 4, 4), got {poses.shape}")
        penetration = np.zeros((len(poses), self.sensor.height, self.sensor.width), np.float32)
        faces = np.full(penetration.shape if with_faces else (len(poses), 0, 0), -1, np.int32)
        kernels.render(self.scene, poses, penetration, faces)
        return penetration, faces
