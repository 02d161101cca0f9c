"""TACTO's shading written out again from its published description, in float64 and pixel by pixel."""

import numpy as np
import pytest

from midastouch_perception.simulation.optics import Illumination, gel_normals, render_gel

# mm in the camera frame (x right, y up, looking along -z), colours RGB
LIGHTS = (((-17.32, 10.0, -5.0), (0, 1, 0)), ((17.32, 10.0, -5.0), (1, 0, 0)), ((0.0, -20.0, -5.0), (0, 0, 1)))
INTENSITY = 2 / 255
BASE, METALLIC, ROUGHNESS = 0.3, 0.2, 0.8


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def written_out(depth, normals, sensor):
    """Grey levels (H, W, 3) of a surface at depth (H, W) m with normals (H, W, 3)."""
    tangent_x, tangent_y = sensor.rays
    points = np.stack([tangent_x * depth, tangent_y * depth, -depth], axis=-1)
    view = unit(-points)
    radiance = np.zeros((*depth.shape, 3))
    for position, colour in LIGHTS:
        position = 1e-3 * np.array(position)
        axis = -unit(np.array([position[0], position[1], 0.0]))
        to_light = position - points
        distance = np.linalg.norm(to_light, axis=-1)
        light = unit(to_light)
        cone = np.clip(2 * (-light @ axis) - 1, 0, 1) ** 2
        half = unit(light + view)
        nl = np.clip((normals * light).sum(-1), 1e-3, 1)
        nv = np.clip(np.abs((normals * view).sum(-1)), 1e-3, 1)
        nh, vh = (normals * half).sum(-1), (view * half).sum(-1)
        f0 = 0.04 * (1 - METALLIC) + BASE * METALLIC
        fresnel = f0 + (1 - f0) * (1 - vh) ** 5
        k = (ROUGHNESS + 1) ** 2 / 8
        geometry = nl / (nl * (1 - k) + k) * nv / (nv * (1 - k) + k)
        a2 = ROUGHNESS**4
        distribution = a2 / (np.pi * (nh**2 * (a2 - 1) + 1) ** 2)
        diffuse = BASE * (1 - 0.04) * (1 - METALLIC)
        reflected = (1 - fresnel) * diffuse / np.pi + fresnel * geometry * distribution / (4 * nl * nv + 1e-3)
        radiance += (INTENSITY * cone / distance**2 * nl * reflected)[..., None] * np.array(colour)
    return 255 * np.clip(radiance ** (1 / 2.2), 0, 1)


def test_undeformed_gel(sensor):
    small = sensor.scaled(0.25)
    rendered = render_gel(np.zeros((80, 60), np.float32), None, small, Illumination.tacto())
    expected = written_out(small.gel_depth, gel_normals(small).astype(float), small)
    assert np.abs(rendered - expected).max() < 0.25
    assert 20 < expected.mean() < 200


@pytest.mark.parametrize("seed", range(3))
def test_any_penetration_and_normals(sensor, seed):
    """To a quarter of a grey level, as well as TACTO itself is known to agree with its description."""
    small = sensor.scaled(0.125)
    rng = np.random.default_rng(seed)
    penetration = rng.uniform(1e-4, 2e-3, (40, 30)).astype(np.float32)
    tilt = rng.normal(0, 0.4, (40, 30, 2))
    normals = unit(np.concatenate([tilt, np.ones((40, 30, 1))], axis=-1))
    rendered = render_gel(penetration, normals.astype(np.float32), small, Illumination.tacto())
    assert np.abs(rendered - written_out(small.gel_depth - penetration, normals, small)).max() < 0.25
