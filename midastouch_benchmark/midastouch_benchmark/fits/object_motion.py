"""How certain a jump of the object must be: slides over procedural objects that rest, and that are pushed.

    .venv/bin/python -m midastouch_benchmark.fits.object_motion --objects 40

Slides over random shapes and parts are measured through the depth network, by sensors near TACTO's and far from it. The
gel is tracked as `OdometryCorrection` does, beside a belief that is right, with a right mount and with one 2 mm and 2
deg off. Printed is, for several levels, how often a motion is detected: falsely while the object rests, and within 10
frames of a push by 5 mm and 5 deg that the belief does not follow.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator

import numpy as np

from midastouch_benchmark.trials.setup import Networks
from midastouch_bringup.datasets.slide_simulation import no_contact_image
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.arm_calibration import jump_hypotheses, odometry_correction
from midastouch_filter.arm_calibration.odometry_correction import OdometryCorrection
from midastouch_filter.core.alignment import PenetrationAlignment
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.gates import Stopwatch
from midastouch_filter.core.noise_model import NoiseModel
from midastouch_filter.core.touch import MAP_SCALE, Measurement, reduced_penetration
from midastouch_perception.contact import ContactDetector
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.simulation.optics import TactoOptics
from midastouch_perception.simulation.procedural import random_shape
from midastouch_perception.simulation.random_parts import random_part
from midastouch_perception.simulation.randomisation import RandomSensor
from midastouch_perception.simulation.slide import measure_poses, simulate_slide

LENGTH, FRAME_TIME = 0.3, 0.05  # m; s
MAKERS = random_shape, random_shape, random_part, random_part
"""Of the objects, by turns: half of them have straight edges and walls, each of both with both sensors."""
PUSHED, WITHIN = 5, 10  # frames
LEVELS = 3.0, 6.0, 9.0, 12.0, 18.0  # nats


class SureBelief:
    """What the correction asks of a belief, for a filter that is sure of a pose (4, 4)."""

    aligned = (0,)

    def __init__(self, pose: np.ndarray):
        self.modes = self.answers = [self]
        self.pose = pose


def slides(networks: Networks, objects: int) -> Iterator[tuple[ObjectMesh, np.ndarray, np.ndarray]]:
    """Mesh, poses (N, 4, 4) and measured maps (N, 80, 60) of a slide over each of so many objects."""
    sensor = networks.sensor.for_maps
    for number in range(objects):
        rng = np.random.default_rng([77, number])
        mesh = MAKERS[number % len(MAKERS)](rng, f"object {number}")
        try:
            poses = simulate_slide(mesh, networks.sensor, LENGTH, rng)
        except InputError:  # it got stuck
            continue
        penetration, normals = PenetrationRenderer(mesh, sensor).render_with_normals(poses)
        background = no_contact_image(sensor, rng)
        if number % 2:
            images, background = RandomSensor(sensor, background[None], rng).images(penetration, normals, rng)
        else:
            optics = TactoOptics(sensor)
            images = [optics.image(p, background, rng, n, 1.0) for p, n in zip(penetration, normals, strict=True)]
        detector = ContactDetector(sensor)
        measurement = [
            detector.update(networks.tdn.penetration(image.astype(np.float32) - background)).penetration
            for image in images
        ]
        yield mesh, poses, np.array([reduced_penetration(each) for each in measurement])


def random_motion(rng: np.random.Generator, translation: float, rotation_deg: float) -> np.ndarray:
    """Tangent vector (6,) of so many m and deg in random directions."""
    directions = rng.standard_normal((2, 3))
    sizes = np.array([[translation], [np.radians(rotation_deg)]])
    return (directions * sizes / np.linalg.norm(directions, axis=1, keepdims=True)).reshape(6)


def detections(
    alignment: PenetrationAlignment, believed: np.ndarray, maps: np.ndarray, measured: np.ndarray, level: float
) -> np.ndarray:
    """Whether the object was said to move in each of N frames, in which the filter is sure of the poses `believed`
    (N, 4, 4)."""
    jump_hypotheses.DECISIVE = odometry_correction.DECISIVE = level
    config, out = FilterConfig(), np.zeros(len(believed), bool)
    correction = OdometryCorrection(alignment, config, NoiseModel.of(config), Stopwatch(lambda: 0.0))
    for i, (pose, measurement, odometry) in enumerate(zip(believed, maps, se3.odometry(measured), strict=True)):
        touch = Measurement(bool(measurement.any()), penetration=measurement)
        correction(odometry, touch, FRAME_TIME)
        out[i] = correction.jump is not None
        correction.observe(SureBelief(pose), touch, trusted=True)
    return out


def main() -> None:
    """Print the statistics."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, default=40, metavar="N")
    parser.add_argument("--repeats", type=int, default=2, metavar="N", help="of each slide, with another noise")
    args = parser.parse_args()
    networks, noise = Networks.load(), NoiseModel.of(FilterConfig())
    frames, pushes, false, noticed = 0, 0, Counter(), Counter()
    for mesh, truth, maps in slides(networks, args.objects):
        alignment = PenetrationAlignment(mesh, networks.sensor.scaled(MAP_SCALE), noise)
        rng = np.random.default_rng(frames)
        for repeat in range(args.repeats):
            askew = se3.exp(random_motion(rng, 2e-3, 2.0)) if repeat % 2 else np.eye(4)
            measured = measure_poses(truth, rng) @ askew
            start = int(rng.integers(len(truth) // 3, len(truth) - WITHIN))
            fraction = np.clip((np.arange(len(truth)) - start + 1) / PUSHED, 0, 1)
            push = se3.exp(fraction[:, None] * random_motion(rng, 5e-3, 5.0))
            pushed = truth[start] @ push @ se3.inverse(truth[start]) @ measured
            end = start + WITHIN + 1
            with_arm = truth[start - 1] @ se3.inverse(pushed[start - 1]) @ pushed[start:end]
            believed = np.concatenate([truth[:start], with_arm])
            frames, pushes = frames + len(truth), pushes + 1
            for level in LEVELS:
                false[level] += detections(alignment, truth, maps, measured, level).sum()
                noticed[level] += detections(alignment, believed, maps[:end], pushed[:end], level)[start:].any()
        print(f"{mesh.name}: done", flush=True)
    for level in LEVELS:
        said = f"{false[level]} motions in {frames} frames at rest; {noticed[level]} of {pushes} pushes noticed"
        print(f"at {level:g} nats: {said}")


if __name__ == "__main__":
    main()
