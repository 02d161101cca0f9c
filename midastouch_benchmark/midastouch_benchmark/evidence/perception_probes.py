"""Probes of simulator, networks, renderer and codebook at fixed poses, each stage with its own input, and of the poses
of a slide."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.slide import simulate_slide

from .probe import Probe, Probes
from .scene import ProbeScene

_TOUCHES, _ENTRIES, _NUMBERS = 4, 12, 12  # touches, entries of a codebook, numbers of a code
_BLOCKS = 4, 3  # of an image or a map
_SLIDE = 0.09  # m
Nudge = Callable[[np.ndarray], np.ndarray]


def perception_probes(scene: ProbeScene, nudge: Nudge = lambda values: values) -> Probes:
    """Return probes by name; nudge: changes images, poses and maps before a stage gets them."""
    networks, poses = scene.networks, scene.poses[:_TOUCHES]
    images, background = scene.images(poses)
    pipeline = networks.pipeline()
    contacts = [pipeline.process(nudge(image), background).contact for image in images]
    small = PenetrationRenderer(scene.mesh, networks.sensor.for_maps)
    maps = small.render(nudge(poses))
    book = scene.codebook
    entries = slice(None, None, len(book.poses) // _ENTRIES)
    return {
        "images": Probe(block_means(images.mean(axis=-1)), [0.1] * 12),
        "depth": Probe(block_means(np.array([each.penetration for each in contacts])), [2e-6] * 12),
        "contact": Probe(np.array([[1e6 * each.area_m2] for each in contacts]), [0.5]),
        "rendered": Probe(block_means(maps), [1e-6] * 12),
        "codes": Probe(networks.tcn.encode(nudge(maps))[:, :_NUMBERS], [1e-3] * _NUMBERS),
        "book": Probe(book.poses[entries, :3].reshape(-1, 12), [1e-4] * 12),
        "book's codes": Probe(book.codes[entries, :_NUMBERS], [2e-3] * _NUMBERS),
        "calibration of codes": Probe(np.array([[book.meta["temperature"], book.meta["outlier"]]]), [1e-6] * 2),
    }


def slide_probes(scenes: list[ProbeScene]) -> Probes:
    """Return a probe of a slide over each object, by object."""
    return {each.mesh.name: _slide(each) for each in scenes}


def _slide(scene: ProbeScene) -> Probe:
    poses = simulate_slide(scene.mesh, scene.networks.sensor, _SLIDE, np.random.default_rng(0))
    return Probe(np.hstack([poses[:, :3, 3], poses[:, :3, :2].reshape(-1, 6)]), [1e-6] * 3 + [1e-4] * 6)


def block_means(pictures: np.ndarray) -> np.ndarray:
    """Return means (N, 12) over the blocks of pictures (N, H, W)."""
    rows = np.array_split(pictures, _BLOCKS[0], axis=1)
    return np.stack([b.mean(axis=(1, 2)) for row in rows for b in np.array_split(row, _BLOCKS[1], axis=2)], axis=1)
