"""A picture of a mesh with points, lines and axes on it, drawn by a z-buffer in software.

It is drawn at twice the wanted resolution and averaged, with smooth shading up to creases of 40 degrees and
darkened depth edges, so that shape can be read without colour.
"""

from __future__ import annotations

import copy
import dataclasses

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.mesh import ObjectMesh


@dataclasses.dataclass(frozen=True)
class Camera:
    """Orthographic camera that looks at `centre` (3,) m of the object frame; pixels are squares of `pixel_size` m.

    rotation (3, 3): rows are the picture's right, up and towards-viewer directions in the object frame.
    """

    rotation: np.ndarray
    centre: np.ndarray
    pixel_size: float
    width: int
    height: int

    @classmethod
    def around(cls, points: np.ndarray, towards_viewer: np.ndarray, up: np.ndarray, width: int, height: int) -> Camera:
        """The camera on the side `towards_viewer` (3,) that shows all points (N, 3) with a 6 % margin."""
        z = np.asarray(towards_viewer, float) / np.linalg.norm(towards_viewer)
        x = np.cross(up, z)
        if np.linalg.norm(x) < 1e-3:  # looking along `up`: any other direction serves
            x = np.cross(np.roll(up, 1), z)
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(z, x), z])
        seen = points @ rotation.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        spread = high - low
        pixel_size = 1.06 * max(spread[0] / width, spread[1] / height)
        return cls(rotation, rotation.T @ ((low + high) / 2), float(pixel_size), width, height)

    def scaled(self, factor: int) -> Camera:
        """The same picture with `factor` times as many pixels along each side."""
        return dataclasses.replace(
            self, pixel_size=self.pixel_size / factor, width=self.width * factor, height=self.height * factor
        )

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel positions (..., 2) and heights towards the viewer (...) m of points (..., 3) m."""
        seen = (np.asarray(points, float) - self.centre) @ self.rotation.T
        column = seen[..., 0] / self.pixel_size + self.width / 2
        row = -seen[..., 1] / self.pixel_size + self.height / 2
        return np.stack([column, row], axis=-1), seen[..., 2]

    def unproject(self, columns: np.ndarray, rows: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Points (..., 3) m of the object frame behind pixel positions at heights (...) m towards the
        viewer."""
        x = (columns - self.width / 2) * self.pixel_size
        y = -(rows - self.height / 2) * self.pixel_size
        return np.stack([x, y, heights], axis=-1) @ self.rotation + self.centre


def best_direction(normals: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Direction (3,) from which surface with normals (N, 3) is seen most squarely, a little from above."""
    n = 200
    k = np.arange(n) + 0.5
    z, azimuth = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - z**2)
    directions = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)
    # square root: two sides seen at a slant are worth more than one seen squarely
    facing = np.sqrt(np.maximum(directions @ np.asarray(normals).T, 0.0))
    score = facing @ (np.ones(len(normals)) if weights is None else weights) / len(normals)
    steep = np.abs(directions[:, 2])
    return directions[int(np.argmax(score - 0.3 * np.maximum(steep - 0.7, 0) + 0.05 * directions[:, 2]))]


SURFACE_COLOUR = np.array([0.80, 0.82, 0.85])
AXIS_COLOURS = np.array([[0.86, 0.16, 0.16], [0.13, 0.62, 0.22], [0.15, 0.33, 0.88]])
_SAMPLES = 2
_DEPTH_SLACK = 0.003  # m behind the surface that still count as visible: a sensor is pressed up to 2 mm into it
_LIGHT = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])


class Canvas:
    """Picture in the making: draw the mesh first, then everything on it; `image()` returns the picture so far."""

    def __init__(self, camera: Camera):
        self.camera = camera.scaled(_SAMPLES)
        shape = (self.camera.height, self.camera.width)
        self._colour = np.ones((*shape, 3))
        self._height = np.full(shape, -np.inf)

    def copy(self) -> Canvas:
        """The same picture, to be drawn on separately."""
        other = copy.copy(self)
        other._colour, other._height = self._colour.copy(), self._height.copy()
        return other

    def draw_mesh(self, mesh: ObjectMesh) -> None:
        """Draw the surface in `SURFACE_COLOUR`; `paint` changes it point by point."""
        corners, heights = self.camera.project(mesh.vertices[mesh.faces])
        normals = mesh.corner_normals @ self.camera.rotation.T
        normal = np.zeros(self._colour.shape)
        kernels.draw_triangles(corners, np.ascontiguousarray(heights), normals, self._height, normal)
        self._rows, self._columns = np.nonzero(np.isfinite(self._height))
        n = normal[self._rows, self._columns]
        diffuse = np.maximum(n @ _LIGHT, 0)
        halfway = _LIGHT + np.array([0.0, 0.0, 1.0])
        gloss = np.maximum(n @ (halfway / np.linalg.norm(halfway)), 0) ** 40
        edges = self._edge_darkening()[self._rows, self._columns]
        self._light = (0.58 + 0.10 * n[:, 1] + 0.50 * diffuse) * edges
        self._gloss = 0.10 * gloss * edges
        self.paint(np.broadcast_to(SURFACE_COLOUR, (len(n), 3)))

    def surface_points(self) -> np.ndarray:
        """Return the point of the mesh behind each visible pixel: (P, 3) m, object frame."""
        heights = self._height[self._rows, self._columns]
        return self.camera.unproject(self._columns + 0.5, self._rows + 0.5, heights)

    def paint(self, colours: np.ndarray) -> None:
        """Colour the drawn surface: RGB in [0, 1] (P, 3) in the order of `surface_points`."""
        shaded = colours * self._light[:, None] + self._gloss[:, None]
        self._colour[self._rows, self._columns] = shaded

    def _edge_darkening(self) -> np.ndarray:
        """Factor (H, W) that darkens pixels lying behind their neighbours (eye-dome lighting)."""
        finite = np.isfinite(self._height)
        # a pixel outside the object counts as level: silhouettes are visible without a dark rim
        height = np.where(finite, self._height, np.nan)
        scale = 60 * self.camera.pixel_size
        padded, (rows, columns) = np.pad(height, 6, mode="edge"), height.shape
        occlusion = np.zeros(height.shape)
        for radius in (2, 6):
            for down, right in ((0, radius), (0, -radius), (radius, 0), (-radius, 0)):
                rise = padded[6 + down :, 6 + right :][:rows, :columns] - height
                occlusion += np.clip(np.nan_to_num(rise) / scale, 0, 0.5)
        return np.exp(-0.9 * occlusion)

    def draw_points(
        self,
        points: np.ndarray,
        colours: np.ndarray,
        radius: float = 3.0,
        alpha: float = 0.85,
        hidden_alpha: float = 0.12,
    ) -> None:
        """Draw discs of `radius` px at points (N, 3) m with colours (3,) or (N, 3) in [0, 1].

        Points behind the surface are drawn with `hidden_alpha`.
        """
        if len(points) == 0:
            return
        centres, heights = self.camera.project(points)
        order = np.argsort(heights, kind="stable")
        colours = np.ascontiguousarray(np.broadcast_to(colours, (len(points), 3))[order], float)
        kernels.draw_discs(
            centres[order],
            heights[order] + _DEPTH_SLACK,
            colours,
            radius * _SAMPLES,
            alpha,
            hidden_alpha,
            self._height,
            self._colour,
        )

    def draw_lines(
        self, starts: np.ndarray, ends: np.ndarray, colours: np.ndarray, radius: float, hidden_alpha: float = 0.25
    ) -> None:
        """Draw straight lines between starts and ends (N, 3) m, `radius` px thick to either side."""
        starts, ends = np.atleast_2d(starts), np.atleast_2d(ends)
        colours = np.broadcast_to(colours, (len(starts), 3))
        length = np.linalg.norm(ends - starts, axis=1) / self.camera.pixel_size
        for start, end, colour, pixels in zip(starts, ends, colours, length, strict=True):
            s = np.linspace(0, 1, max(int(pixels), 2))[:, None]
            # many overlapping discs: a low alpha each would add up, so hidden lines thin out instead
            shown = start + s * (end - start)
            self.draw_points(shown, colour, radius, alpha=1.0, hidden_alpha=0.0)
            if hidden_alpha > 0:
                self.draw_points(shown[:: 6 * _SAMPLES], colour, radius * 0.7, alpha=0.0, hidden_alpha=hidden_alpha)

    def draw_axes(self, pose: np.ndarray, length: float, radius: float = 1.8, halo: bool = False) -> None:
        """Draw the x, y, z axes (red, green, blue) of a pose (4, 4), `length` m long; `halo` rims them
        white."""
        origin = pose[:3, 3]
        tips = origin + length * pose[:3, :3].T
        if halo:
            self.draw_lines(np.repeat(origin[None], 3, axis=0), tips, np.ones(3), radius + 1.3, hidden_alpha=0)
        self.draw_lines(np.repeat(origin[None], 3, axis=0), tips, AXIS_COLOURS, radius)

    def draw_ellipse(self, centre: np.ndarray, covariance: np.ndarray, colour: np.ndarray) -> None:
        """Outline the 2-sigma ellipse of a position covariance (3, 3) m^2 about `centre` (3,), seen by the camera."""
        plane = self.camera.rotation[:2]
        values, vectors = np.linalg.eigh(plane @ covariance @ plane.T)
        turn = np.linspace(0, 2 * np.pi, 73)
        circle = np.stack([np.cos(turn), np.sin(turn)])
        outline = (vectors @ (2 * np.sqrt(np.maximum(values, 0))[:, None] * circle)).T @ plane + centre
        # lifted towards the viewer: an outline half sunk into the surface would read as two arcs
        outline = outline + 0.02 * self.camera.rotation[2]
        self.draw_lines(outline[:-1], outline[1:], colour, radius=1.0, hidden_alpha=0)

    def image(self) -> np.ndarray:
        """The picture (H, W, 3) uint8."""
        h, w = self._colour.shape[0] // _SAMPLES, self._colour.shape[1] // _SAMPLES
        blocks = np.clip(self._colour, 0, 1).reshape(h, _SAMPLES, w, _SAMPLES, 3)
        return (255 * blocks.mean(axis=(1, 3)) + 0.5).astype(np.uint8)
