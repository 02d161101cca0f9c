"""Find a ball's contact in one image, whatever the lights.

Under any light that is linear in the slopes, each colour of a pressed ball is a dipole: a multiple of the ball's slope
to the right plus a multiple of its slope downwards. A matched filter for the two needs nothing of the sensor.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

_HALF = 2  # px of the image to one of the search
_SCALES = np.linspace(0.2, 0.95, 31)  # contact radii looked for, of the ball's
_REACH = 0.3e-3  # m over which the gel's slope dies away beside the contact
_LENS = 0.08e-3  # m: blur
_LEAST_SEEN = 0.6  # of a contact, by its dipoles' energy


@dataclasses.dataclass(frozen=True)
class Contact:
    """A circle in which a ball touches: column u and row v of its middle [px], radius [m]; explained, share
    (0 ... 1) of the image's change that a ball there explains."""

    u: float
    v: float
    radius: float
    explained: float

    def distance(self, other: Contact) -> float:
        """Between the middles [px]."""
        return float(np.hypot(self.u - other.u, self.v - other.v))


def find_contact(change: np.ndarray, ball_radius: float, pixel: float) -> Contact:
    """The most likely contact in a change (H, W, 3) grey levels; ball_radius m, pixel m per pixel."""
    small = cv2.resize(change, None, fx=1 / _HALF, fy=1 / _HALF, interpolation=cv2.INTER_AREA)
    channels = [np.ascontiguousarray(small[..., c]) for c in range(3)]
    energy = float((small**2).sum()) + 1e-9
    inside = np.ones(small.shape[:2], np.float32)
    best = Contact(0.0, 0.0, 0.0, -1.0)
    for radius in _SCALES * ball_radius:
        explained, seen = np.zeros_like(inside), np.zeros_like(inside)
        for dipole in _dipoles(radius, ball_radius, _HALF * pixel):
            whole = float((dipole**2).sum())
            within = _correlate(inside, dipole**2)
            explained += sum(_correlate(c, dipole) ** 2 for c in channels) / np.maximum(within, 0.3 * whole)
            seen += within / (2 * whole)
        explained[seen < _LEAST_SEEN] = 0
        row, column = np.unravel_index(explained.argmax(), explained.shape)
        if (share := float(explained[row, column]) / energy) > best.explained:
            # the middle of a block of pixels
            u, v = (_HALF * i + (_HALF - 1) / 2 for i in (column, row))
            best = Contact(u, v, radius, share)
    return best


def _dipoles(radius: float, ball_radius: float, pixel: float) -> list[np.ndarray]:
    """Slopes to the right and down of a ball that touches in a circle of `radius` m."""
    reach = int(np.ceil((radius + 4 * _REACH) / pixel))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1] * pixel
    away = np.hypot(x, y) + 1e-9
    touched = np.minimum(away, radius)
    slope = touched / np.sqrt(ball_radius**2 - touched**2) * np.exp((touched - away) / _REACH)
    blur = max(_LENS / pixel, 0.3)
    return [cv2.GaussianBlur((-slope * along / away).astype(np.float32), (0, 0), blur) for along in (x, y)]


def _correlate(image: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return cv2.filter2D(image, cv2.CV_32F, kernel, borderType=cv2.BORDER_CONSTANT)
