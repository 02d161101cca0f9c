"""What the DIGIT's camera sees of the gel: light, material and image formation.

`TactoOptics` computes what the TACTO simulator renders for a DIGIT, in closed form: three coloured spot lights on a
rough, slightly metallic gel, gamma, and half the difference to the undeformed gel added to a real no-contact image.
`randomisation.py` varies the same model far beyond TACTO.
"""

from __future__ import annotations

import dataclasses
import math

import cv2
import numba
import numpy as np

from ..sensor_model import SensorModel

_GAMMA = 1 / 2.2


@dataclasses.dataclass(frozen=True)
class Illumination:
    """Spot lights and gel material in the camera frame (x right, y up, looking along -z), metres.

    Attributes: positions (L, 3) m; colours (L, 3), linear RGB radiance at 1 m; cone, cosine falloff of the spots:
    1 as in TACTO (60 deg), 0 for lights that shine everywhere; base, reflectance; metallic; roughness.
    """

    positions: np.ndarray
    colours: np.ndarray
    cone: float = 1.0
    base: float = 0.3
    metallic: float = 0.2
    roughness: float = 0.8

    @classmethod
    def tacto(cls) -> Illumination:
        """The `digit_shadow` configuration the paper uses: green, red and blue on a 20 mm ring."""
        angles = np.radians([150.0, 30.0, 270.0])
        positions = np.stack([0.02 * np.cos(angles), 0.02 * np.sin(angles), np.full(3, -0.005)], axis=1)
        # intensity 2 divided by 255, because TACTO passes its colours as integers
        return cls(positions, np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]]) * (2 / 255))


class TactoOptics:
    """TACTO's images of penetration maps, for one sensor model at its resolution."""

    def __init__(self, sensor: SensorModel, illumination: Illumination | None = None):
        self.sensor = sensor
        self._illumination = illumination or Illumination.tacto()
        # TACTO's 7 x 7 Gaussian has 1.4 px at 240 x 320
        self._blur = 1.4 * sensor.height / 320
        self._rest = render_gel(np.zeros((sensor.height, sensor.width), np.float32), None, sensor, self._illumination)

    def difference(self, penetration: np.ndarray, normals: np.ndarray | None = None) -> np.ndarray:
        """Change (H, W, 3) float32, grey levels, of the image by a contact of `penetration` (H, W) m.

        normals (H, W, 3): the touching surface's, gel frame, 0 outside (`render_with_normals`); without them they are
        taken from the penetration map's slope.
        """
        if normals is None:
            change = render_gel(penetration, None, self.sensor, self._illumination) - self._rest
        else:
            # only what is touched looks different, a small part of the image
            touched = np.flatnonzero(penetration > 0)
            gel_depth, *tangents = (a.ravel()[None, touched] for a in (self.sensor.gel_depth, *self.sensor.rays))
            depth = gel_depth - penetration.ravel()[touched]
            pressed = shade(depth, normals.reshape(-1, 3)[None, touched], *tangents, self._illumination)[0]
            change = np.zeros_like(self._rest)
            change.reshape(-1, 3)[touched] = pressed - self._rest.reshape(-1, 3)[touched]
        return cv2.GaussianBlur(0.5 * change, (0, 0), self._blur)

    def image(
        self,
        penetration: np.ndarray,
        background: np.ndarray,
        rng: np.random.Generator,
        normals: np.ndarray | None = None,
        noise: float = 2.0,
    ) -> np.ndarray:
        """Camera image (H, W, 3) uint8 RGB over a no-contact image `background` (H, W, 3) uint8.

        noise: standard deviation in grey levels of the pixel noise.
        """
        clean = np.clip(self.difference(penetration, normals) + background, 0, 255)
        noisy = np.floor(clean) + noise * rng.standard_normal(clean.shape, np.float32)
        return np.clip(noisy, 0, 255).astype(np.uint8)


def gel_normals(sensor: SensorModel, depth: np.ndarray | None = None) -> np.ndarray:
    """Unit normals (H, W, 3) float32, gel frame, of a depth map (H, W) m; of the undeformed gel by default."""
    depth = sensor.gel_depth if depth is None else depth
    tangent_x, tangent_y = sensor.rays
    points = np.stack([tangent_x * depth, tangent_y * depth, -depth], axis=-1).astype(np.float32)
    along_u = np.gradient(points, axis=1)
    along_v = np.gradient(points, axis=0)
    normals = np.cross(along_v, along_u)
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-20)


def render_gel(
    penetration: np.ndarray, normals: np.ndarray | None, sensor: SensorModel, illumination: Illumination
) -> np.ndarray:
    """Rendered gel (H, W, 3) float32, grey levels 0 ... 255, before blur, background and noise."""
    depth = (sensor.gel_depth - penetration).astype(np.float32)
    if normals is None:
        shading = gel_normals(sensor, depth)
    else:
        rest = gel_normals(sensor)
        shading = np.where((penetration > 0)[..., None], normals, rest).astype(np.float32)
    tangent_x, tangent_y = sensor.rays
    return shade(depth, shading, tangent_x, tangent_y, illumination)


def shade(
    depth: np.ndarray, normals: np.ndarray, tangent_x: np.ndarray, tangent_y: np.ndarray, light: Illumination
) -> np.ndarray:
    """Shaded surface (H, W, 3) float32 grey levels for depth (H, W) m and normals (H, W, 3), gel frame."""
    c_diffuse = light.base * 0.96 * (1 - light.metallic)
    f0 = 0.04 + (light.base - 0.04) * light.metallic
    return _shade(
        np.ascontiguousarray(depth, np.float32),
        np.ascontiguousarray(normals, np.float32),
        np.ascontiguousarray(tangent_x, np.float32),
        np.ascontiguousarray(tangent_y, np.float32),
        light.positions.astype(np.float32),
        light.colours.astype(np.float32),
        np.float32(light.cone),
        np.float32(c_diffuse / math.pi),
        np.float32(f0),
        np.float32(light.roughness),
    )


@numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _shade(depth, normals, tangent_x, tangent_y, positions, colours, cone, diffuse, f0, roughness):
    """Metallic-roughness shading (glTF 2.0, appendix B) with spot lights that point at the optical axis."""
    height, width = depth.shape
    out = np.empty((height, width, 3), np.float32)
    one = np.float32(1)
    kk = (roughness + one) ** 2 / np.float32(8)
    a2 = roughness**4
    for v in range(height):
        for u in range(width):
            d = depth[v, u]
            x, y, z = tangent_x[v, u] * d, tangent_y[v, u] * d, -d
            nx, ny, nz = normals[v, u, 0], normals[v, u, 1], normals[v, u, 2]
            view = one / np.sqrt(x * x + y * y + z * z)
            vx, vy, vz = -x * view, -y * view, -z * view
            nv = min(max(abs(nx * vx + ny * vy + nz * vz), np.float32(1e-3)), one)
            red = green = blue = np.float32(0)
            for k in range(positions.shape[0]):
                lx, ly, lz = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
                squared = lx * lx + ly * ly + lz * lz
                inverse = one / np.sqrt(squared)
                lx, ly, lz = lx * inverse, ly * inverse, lz * inverse
                ring = np.sqrt(positions[k, 0] ** 2 + positions[k, 1] ** 2)
                # spot axis: from the light towards the optical axis, parallel to the gel plane
                towards = (lx * positions[k, 0] + ly * positions[k, 1]) / max(ring, np.float32(1e-9))
                spot = min(max(2 * towards - one, np.float32(0)), one)
                strength = (one - cone + cone * spot * spot) / squared
                hx, hy, hz = lx + vx, ly + vy, lz + vz
                half = one / np.sqrt(hx * hx + hy * hy + hz * hz)
                nl = min(max(nx * lx + ny * ly + nz * lz, np.float32(1e-3)), one)
                nh = min(max((nx * hx + ny * hy + nz * hz) * half, np.float32(0)), one)
                vh = min(max((vx * hx + vy * hy + vz * hz) * half, np.float32(0)), one)
                grazing = one - vh
                fresnel = f0 + (one - f0) * grazing * grazing * grazing * grazing * grazing
                shadowing = nl / (nl * (one - kk) + kk) * nv / (nv * (one - kk) + kk)
                lobe = nh * nh * (a2 - one) + one
                microfacets = a2 / (np.float32(math.pi) * lobe * lobe)
                reflected = (one - fresnel) * diffuse + fresnel * shadowing * microfacets / (
                    4 * nl * nv + np.float32(1e-3)
                )
                energy = strength * nl * reflected
                red += energy * colours[k, 0]
                green += energy * colours[k, 1]
                blue += energy * colours[k, 2]
            out[v, u, 0] = 255 * min(red, one) ** np.float32(_GAMMA)
            out[v, u, 1] = 255 * min(green, one) ** np.float32(_GAMMA)
            out[v, u, 2] = 255 * min(blue, one) ** np.float32(_GAMMA)
    return out
