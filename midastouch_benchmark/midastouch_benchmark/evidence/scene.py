"""Scenes for the probes of a fingerprint: touches of bundled objects, made like those of reports."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.touch import Measurement, measurement_of
from midastouch_perception.codebook import Codebook
from midastouch_perception.codebook_build import CodebookBuild
from midastouch_perception.objects import bundled_objects
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_simulation.camera import TactoCamera
from midastouch_simulation.grasp import simulate_grasp
from midastouch_simulation.slide import measure_poses
from midastouch_tools.datasets.slide_simulation import NOISE_R, NOISE_T

from ..trials.cache import LIGHT
from ..trials.setup import Networks
from ..trials.trial import FRAME_TIME, TrialFrame

# by object; each touch is a keyframe. In a file, so that a change to the simulated slides does not change the touches
_POSES_OF = Path(__file__).parent / "poses.npz"
_POSES = 3_000
NUDGE = 1e-6
"""Relative error of the inputs of a nudged probe, as large as machines differ."""


@dataclass(frozen=True)
class ProbeScene:
    """Touches on a small object: mesh, networks, true poses (N, 4, 4) of touches 12 mm apart."""

    mesh: ObjectMesh
    networks: Networks
    poses: np.ndarray

    @classmethod
    def of(cls, name: str) -> ProbeScene:
        """Return the scene of a bundled object whose poses are in the file."""
        with np.load(_POSES_OF) as poses:
            return cls(ObjectMesh.load(bundled_objects()[name]), Networks.load(light=LIGHT), poses[name])

    @cached_property
    def codebook(self) -> Codebook:
        """Small codebook of the whole surface."""
        return CodebookBuild(self.mesh, self.networks.tcn, self.networks.sensor, _POSES).run()

    def images(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return images (N, H, W, 3) uint8 at poses (N, 4, 4), and the no-contact image (H, W, 3)."""
        rng = np.random.default_rng(0)
        camera = TactoCamera(self.networks.sensor, rng)
        maps, normals = PenetrationRenderer(self.mesh, self.networks.sensor).render_with_normals(poses)
        return np.array([camera.image(*each, rng) for each in zip(maps, normals, strict=True)]), camera.background

    @cached_property
    def frames(self) -> list[TrialFrame]:
        """Frames of the slide, as a filter gets them."""
        return self._perceived(self.poses, measure_poses(self.poses, np.random.default_rng(0), NOISE_T, NOISE_R))

    def _perceived(self, poses: np.ndarray, measured: np.ndarray) -> list[TrialFrame]:
        pipeline, (images, background) = self.networks.pipeline(), self.images(poses)
        touches = [measurement_of(pipeline.process(image, background)) for image in images]
        return [
            TrialFrame(k, touch, {}, at, truth, FRAME_TIME)
            for k, (touch, at, truth) in enumerate(zip(touches, measured, poses, strict=True))
        ]

    @cached_property
    def grasp(self) -> list[TrialFrame]:
        """Frames of a grasp, one for each contact, as `protocols.grasp` gets them."""
        poses = simulate_grasp(self.mesh, self.networks.sensor, np.random.default_rng(0))
        return self._perceived(poses, poses)


def off(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return numbers off by `NUDGE`; of grey levels from 0 to 255, a few are off by one."""
    if values.dtype == np.uint8:
        return np.where(rng.random(values.shape) < NUDGE * 255, values ^ 1, values)
    return (values * (1 + NUDGE * rng.uniform(-1, 1, values.shape))).astype(values.dtype)


def nudged(frames: list[TrialFrame], rng: np.random.Generator) -> list[TrialFrame]:
    """Return the frames with codes, maps and measured poses off by `NUDGE`."""

    def touch(one: Measurement) -> Measurement:
        if not one.in_contact:
            return one
        return dataclasses.replace(one, code=off(one.code, rng), penetration=off(one.penetration, rng))

    def pose(one: np.ndarray) -> np.ndarray:
        out = one.copy()
        out[:3, 3] = off(one[:3, 3], rng)
        return out

    return [
        dataclasses.replace(
            frame,
            measurement=touch(frame.measurement),
            measured=pose(frame.measured),
            others={name: touch(each) for name, each in frame.others.items()},
        )
        for frame in frames
    ]
