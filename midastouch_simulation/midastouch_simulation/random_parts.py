"""Random parts as in CAD exports, with flat walls and sharp edges, which neither scans nor rounded shapes have.

They are used to train the networks and to fit the filter's constants; tests and benchmarks use other parts, with names.
"""

from __future__ import annotations

import numpy as np

from midastouch_common.mesh import ObjectMesh

from .solids import Layer, Outline, circle, gear_outline, lofted, rectangle, repeated, stacked

_HALF_WIDTH = 0.01, 0.05  # m
_THICKNESS = 0.002, 0.03  # m, of a layer
_TAPERED = 0.3  # of the parts, which are rings joined by walls: bottles, cones, prisms that taper


def random_part(rng: np.random.Generator, name: str) -> ObjectMesh:
    """Make a part of 20 ... 100 mm: layers of random outlines with holes and notches, or walls between random rings."""
    return _tapered(rng, name) if rng.random() < _TAPERED else _layered(rng, name)


def _layered(rng: np.random.Generator, name: str) -> ObjectMesh:
    size = np.exp(rng.uniform(*np.log(_HALF_WIDTH)))
    layers = []
    for _ in range(rng.integers(1, 5)):
        outlines = [_outline(size * rng.uniform(0.4, 1.0), rng)]
        if rng.random() < 0.4:
            outlines.append(rng.uniform(-0.5, 0.5, 2) * size + _outline(size * rng.uniform(0.2, 0.6), rng))
        cuts = _cuts(size, rng) if rng.random() < 0.6 else ()
        layers.append(Layer(np.exp(rng.uniform(*np.log(_THICKNESS))), tuple(outlines), cuts))
    return stacked(layers, name)


def _outline(radius: float, rng: np.random.Generator) -> Outline:
    """Draw a closed polygon around the origin, turned at random."""
    kind = rng.integers(5)
    if kind == 0:
        width, depth = 2 * radius * rng.uniform(0.35, 1.0, 2)
        outline = rectangle(width, depth, chamfer=rng.choice([0.0, rng.uniform(0.05, 0.3)]) * min(width, depth))
    elif kind == 1:
        outline = circle(radius)
    elif kind == 2:
        outline = circle(radius, sides=int(rng.integers(3, 9)))
    elif kind == 3:
        outline = gear_outline(int(rng.integers(6, 30)), radius * rng.uniform(0.7, 0.92), radius)
    else:
        angles = 2 * np.pi * (np.arange(count := int(rng.integers(4, 9))) + rng.uniform(-0.35, 0.35, count)) / count
        outline = radius * rng.uniform(0.45, 1.0, (count, 1)) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    angle = rng.uniform(-np.pi, np.pi)
    return outline @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _cuts(size: float, rng: np.random.Generator) -> tuple[Outline, ...]:
    """Draw a bore, a ring of holes or slots, or a notch anywhere."""
    kind, radius = rng.integers(3), size * rng.uniform(0.06, 0.3)
    if kind == 0:
        return (circle(radius, sides=72),)
    if kind == 1:
        hole = rng.choice([24, 4, 6])
        return repeated(circle(min(radius, 0.2 * size), rng.uniform(0.4, 0.8) * size, sides=hole), rng.integers(2, 9))
    return (_outline(radius, rng) + rng.uniform(-1, 1, 2) * size,)


def _tapered(rng: np.random.Generator, name: str) -> ObjectMesh:
    size, sides = np.exp(rng.uniform(*np.log(_HALF_WIDTH))), int(rng.choice([3, 4, 5, 6, 8, 96]))
    levels = int(rng.integers(2, 6))
    heights = np.cumsum(rng.uniform(0.2, 1.2, levels)) * size
    radii = size * rng.uniform(0.25, 1.0, levels)
    return lofted(
        [np.column_stack([circle(r, sides=sides), np.full(sides, z)]) for r, z in zip(radii, heights, strict=True)],
        name,
    )
