"""Ball against the gel: its penetration in closed form, and detection of its contact in an image under any lights.

Under any light that is linear in the slopes, each colour of a pressed ball is a dipole: a multiple of the ball's slope
to the right plus a multiple of its slope downwards. A matched filter for the two needs no knowledge of the sensor.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from ..sensor_model import SensorModel

_SIDES = np.array([-1.0, 1.0])
_SEARCH_PIXEL = 2  # px of the image per pixel of the search
_SEARCHED_RADII = np.linspace(0.2, 0.95, 31)  # contact radii to search for, relative to the ball's radius
_DECAY = 0.3e-3  # m over which the gel's slope decays outside of the contact
_BLUR = 0.08e-3  # m
_LEAST_VISIBLE = 0.6  # of a contact, by its dipoles' energy


def ball_penetration(centre: np.ndarray, radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the penetration (H, W) float32 m of a ball into the undeformed gel, negative or -inf outside the contact.

    centre (3,) m, gel frame; radius m. It is measured along the camera's rays, as in `PenetrationRenderer`.
    """
    tangent_x, tangent_y = sensor.rays
    start = np.array([0, 0, sensor.gel_distance]) - np.asarray(centre, float)  # of every ray, from the ball's centre
    square = tangent_x**2 + tangent_y**2 + 1
    along = tangent_x * start[0] + tangent_y * start[1] - start[2]
    discriminant = along**2 - square * (start @ start - radius**2)
    depth = (-along - np.sqrt(np.maximum(discriminant, 0))) / square
    return np.where(discriminant > 0, sensor.gel_depth - depth, -np.inf).astype(np.float32)


def ball_centre(u: float, v: float, contact_radius: float, radius: float, sensor: SensorModel) -> np.ndarray:
    """Return the centre (3,) m, gel frame, of a ball that touches in a circle of `contact_radius` m about pixel (u, v).

    u, v: column and row, pixel centres at whole numbers; the pixel may lie outside the image.
    """
    tangent_x = (u + 0.5 - sensor.width / 2) / sensor.focal
    tangent_y = -(v + 0.5 - sensor.height / 2) / sensor.focal
    depth = sensor.gel_distance
    for _ in range(20):
        depth = sensor.gel_distance - float(sensor.sag(depth * tangent_x, depth * tangent_y))
    x, y = depth * tangent_x, depth * tangent_y
    step = 2e-4
    (left, right), (below, above) = sensor.sag(x + step * _SIDES, y), sensor.sag(x, y + step * _SIDES)
    here = float(sensor.sag(x, y))
    slopes = np.array([right - left, above - below]) / (2 * step)
    bends = np.array([left + right - 2 * here, below + above - 2 * here]) / step**2 / (1 + slopes**2) ** 1.5
    outward = np.array([*slopes, -1.0]) / np.sqrt(1 + slopes @ slopes)
    # the gel curves away from the ball: the plane of the circle lies above the surface at its middle
    plane = 0.5 * contact_radius**2 * bends.mean()
    return np.array([x, y, sensor.gel_distance - depth]) + outward * (np.sqrt(radius**2 - contact_radius**2) - plane)


@dataclasses.dataclass(frozen=True)
class BallContact:
    """Circle in which a ball touches: column u and row v of its middle [px], radius [m]; explained, fraction (0 ... 1)
    of the image's change that a ball there explains."""

    u: float
    v: float
    radius: float
    explained: float

    def distance(self, other: BallContact) -> float:
        """Return the distance between the middles [px]."""
        return float(np.hypot(self.u - other.u, self.v - other.v))


def find_contact(change: np.ndarray, ball_radius: float, pixel: float) -> BallContact:
    """Return the most likely contact in a change (H, W, 3) grey levels; ball_radius m, pixel m per pixel."""
    small = cv2.resize(change, None, fx=1 / _SEARCH_PIXEL, fy=1 / _SEARCH_PIXEL, interpolation=cv2.INTER_AREA)
    channels = [np.ascontiguousarray(small[..., c]) for c in range(3)]
    energy = float((small**2).sum()) + 1e-9
    inside = np.ones(small.shape[:2], np.float32)
    best = BallContact(0.0, 0.0, 0.0, -1.0)
    for radius in _SEARCHED_RADII * ball_radius:
        explained, seen = np.zeros_like(inside), np.zeros_like(inside)
        for dipole in _dipoles(radius, ball_radius, _SEARCH_PIXEL * pixel):
            whole = float((dipole**2).sum())
            within = _correlate(inside, dipole**2)
            explained += sum(_correlate(c, dipole) ** 2 for c in channels) / np.maximum(within, 0.3 * whole)
            seen += within / (2 * whole)
        explained[seen < _LEAST_VISIBLE] = 0
        row, column = np.unravel_index(explained.argmax(), explained.shape)
        if (fraction := float(explained[row, column]) / energy) > best.explained:
            # the middle of a block of pixels
            u, v = (_SEARCH_PIXEL * i + (_SEARCH_PIXEL - 1) / 2 for i in (column, row))
            best = BallContact(u, v, radius, fraction)
    return best


def _dipoles(radius: float, ball_radius: float, pixel: float) -> list[np.ndarray]:
    """Return the slopes to the right and down of a ball that touches in a circle of `radius` m."""
    reach = int(np.ceil((radius + 4 * _DECAY) / pixel))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1] * pixel
    away = np.hypot(x, y) + 1e-9
    touched = np.minimum(away, radius)
    slope = touched / np.sqrt(ball_radius**2 - touched**2) * np.exp((touched - away) / _DECAY)
    blur = max(_BLUR / pixel, 0.3)
    return [cv2.GaussianBlur((-slope * along / away).astype(np.float32), (0, 0), blur) for along in (x, y)]


def _correlate(image: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return cv2.filter2D(image, cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT)
