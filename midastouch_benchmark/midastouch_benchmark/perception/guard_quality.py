"""Frames that the guards of the node `tdn` refuse, good ones and damaged ones, of imaginary sensors that slide."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.torn_frames import TornFrames
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.tdn.colour_layout import ORIENTATIONS
from midastouch_perception.tdn.fixed_pattern import pattern_problem
from midastouch_simulation.simulated_digit import SimulatedDigit
from midastouch_simulation.slide import simulate_slide
from midastouch_simulation.training.setting import load_backgrounds
from midastouch_tools.progress import progress_bar

from ..statistics.intervals import Figures
from ..trials.object_sets import chosen_meshes

SENSORS = "digit_real", "gelsight_mini", "digit_tacto"
STEPS = (0.5e-3, 1.5e-3, 3e-3)
"""Distances [m] between two frames: 30 mm/s at 60, 20 and 10 frames/s."""
VISIBLE = 8.0
"""Difference [grey levels] of the two parts of a torn frame from which its seam counts as visible: root mean square
along the seam, of means over 4 x 8 px."""
_FEWEST_LINES = 4  # of each part of a torn frame; fewer change nothing
_FRAMES = 24  # of a slide
_ABOVE = 0.02  # m over the object, before and after
_COMPARED = 6  # frames out of which one is compared with the no-contact image
_ROLLS = ((1, 20), (1, 80), (1, 200), (0, 100))
_TURNS = tuple(ORIENTATIONS)[:4]
WRONG = "rolled", "turned or swapped"


def slide_frames(
    mesh: ObjectMesh, sensor: SensorModel, background: np.ndarray, step: float, seed: int
) -> list[np.ndarray]:
    """Return the images (H, W, 3) uint8 of a touch, a slide and a lift, one `step` [m] apart.

    The first two and the last are free. Empty if there is no such slide on the object.
    """
    try:
        poses = simulate_slide(mesh, sensor, _FRAMES * step, np.random.default_rng(seed), step)
    except InputError:
        return []
    away = poses[0].copy()
    away[:3, 3] += _ABOVE * away[:3, 2]
    digit = SimulatedDigit(mesh, sensor, background, seed)
    return [digit.look(pose).image for pose in (away, away, *poses, away)]


def torn_frame(above: np.ndarray, below: np.ndarray, line: int, axis: int) -> tuple[np.ndarray, float]:
    """Return an image whose lines before `line` are of one image and the others of another, and how far the two differ
    along the seam, as in `VISIBLE`. axis: 0 for rows, 1 for columns."""
    torn = np.moveaxis(above.copy(), axis, 0)
    torn[line:] = np.moveaxis(below, axis, 0)[line:]
    near = slice(max(line - 2, 0), line + 2)
    parts = [np.moveaxis(each, axis, 0)[near].astype(float).mean(axis=0) for each in (above, below)]
    blocks = (parts[1] - parts[0]).reshape(-1, 8, 3).mean(axis=1)
    return np.ascontiguousarray(np.moveaxis(torn, 0, axis)), float(np.sqrt((blocks**2).mean()))


def judged_slide(frames: Sequence[np.ndarray], rng: np.random.Generator) -> Iterator[tuple[str, bool]]:
    """Yield what was shown to the guards and whether they refused it, for the frames of one slide."""
    whole = TornFrames()
    for image in frames:
        yield "good, against the frames before", whole.torn(image)
    for k in range(2, len(frames) - 1):
        axis = int(rng.integers(2))
        line = int(rng.integers(_FEWEST_LINES, frames[k].shape[axis] - _FEWEST_LINES + 1))
        torn, difference = torn_frame(frames[k], frames[k + 1], line, axis)
        stream = TornFrames()
        for before in frames[k - 2 : k]:
            stream.torn(before)
        refused = stream.torn(torn)
        yield "torn", refused
        if difference >= VISIBLE:
            yield f"torn, the parts differ by {VISIBLE:g} grey levels", refused
    background = frames[0]
    for image in frames[1::_COMPARED]:
        yield "good, against the no-contact image", bool(pattern_problem(image, background))
        axis, by = _ROLLS[int(rng.integers(len(_ROLLS)))]
        yield WRONG[0], "rolled by" in pattern_problem(np.roll(image, by, axis), background)
        turn = ORIENTATIONS[_TURNS[int(rng.integers(len(_TURNS)))]]
        yield WRONG[1], bool(pattern_problem(np.ascontiguousarray(turn(image)), background))


def guard_rows(verdicts: Sequence[tuple[str, int, str, bool]]) -> list[dict]:
    """Return a row for each sensor and kind of frames: the fraction that is refused, and its 95 % interval over slides.

    verdicts: of each frame sensor, number of the slide, what it is and whether it was refused.
    """
    frames = pd.DataFrame(verdicts, columns=["sensor", "slide", "what", "refused"])
    return [
        {
            "sensor": sensor,
            "what": what,
            "slides": some["slide"].nunique(),
            "frames": len(some),
            "refused": int(some["refused"].sum()),
        }
        | Figures(some["slide"].tolist()).fraction(some["refused"])
        for (sensor, what), some in frames.groupby(["sensor", "what"], sort=False)
    ]


def report(args: argparse.Namespace) -> dict:
    """Measure which good and which damaged frames the guards refuse."""
    meshes = chosen_meshes(args.meshes, args.objects, "out/benchmark")
    verdicts: list[tuple[str, int, str, bool]] = []
    with progress_bar(total=len(SENSORS) * args.slides, unit="slide") as bar:
        for name in SENSORS:
            sensor = SensorModel.load(name)
            backgrounds = np.concatenate(load_backgrounds(args.backgrounds, sensor.height, sensor.width))
            for slide in range(args.slides):
                rng = np.random.default_rng([args.seed, len(verdicts)])
                mesh, background = meshes[slide % len(meshes)], backgrounds[rng.integers(len(backgrounds))]
                step, seed = STEPS[slide % len(STEPS)], int(rng.integers(2**31))
                frames = slide_frames(mesh, sensor, np.ascontiguousarray(background), step, seed)
                verdicts += [(name, slide, *verdict) for verdict in judged_slide(frames, rng)] if frames else []
                bar.update(1)
    return {"seed": args.seed, "guards": guard_rows(verdicts)}
