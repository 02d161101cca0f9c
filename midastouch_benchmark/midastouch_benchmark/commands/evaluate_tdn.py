"""`midastouch evaluate-tdn`: the depth network against known penetration maps."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from midastouch_tools.commands import arguments

from . import options

if TYPE_CHECKING:
    import numpy as np

    from midastouch_perception.tdn import DepthNet
    from midastouch_tools.datasets import Sequence

    from ..perception.depth_quality import DepthQuality


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "evaluate-tdn",
        run,
        "measure the depth network on sequences with ground truth",
        "midastouch evaluate-tdn ../shared/data/ycb_slide_sim/*/00 --json out/tdn.json",
        "Root mean square error over all pixels and over the touched ones, and how well the contact is\noutlined.",
    )
    parser.add_argument("sequences", nargs="+", metavar="SEQ", help="YCB-Slide sequence folders (simulated)")
    options.add_tdn_option(parser)
    options.add_sensor_option(parser, "")
    options.add_sequence_options(parser)
    options.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import numpy as np

    from midastouch_common.errors import InputError
    from midastouch_perception.sensor_calibration.calibration import SensorCalibration
    from midastouch_perception.sensor_model import SensorModel
    from midastouch_perception.tdn import load_tdn
    from midastouch_tools.datasets import load_sequence
    from midastouch_tools.machine import machine_info
    from midastouch_tools.progress import progress_bar

    from ..perception.depth_quality import DepthQuality
    from ..tables.perception import depth_table
    from ..tables.table import terminal
    from ..trials.setup import require_same_gel, sensor_of, untouched_of

    sequences = [load_sequence(path) for path in args.sequences]
    for sequence in sequences:
        if not sequence.ground_truth_frames:
            raise InputError(f"{sequence.path}: no ground truth (gt_heightmaps); only simulated sequences have it")
    sensor = SensorModel.load(args.sensor or sensor_of(sequences))
    tdn = load_tdn(args.tdn, sensor, SensorCalibration.load(args.calibration) if args.calibration else None)
    untouched = [untouched_of(sequence, args.background) for sequence in sequences]
    require_same_gel(tdn, untouched)
    total, results, times = DepthQuality(), [], []
    with progress_bar(total=sum(len(s.ground_truth_frames) for s in sequences), unit="frame") as bar:
        for sequence, free in zip(sequences, untouched, strict=True):
            bar.set_description(sequence.name)
            quality, ms = _measured(tdn, sequence, free.image, bar.update)
            total.merge(quality)
            times += ms
            mean = {"ms_per_frame": float(np.mean(ms)), "background": free.source}
            results.append({"sequence": sequence.name, **quality.result(), **mean})
    summary = {**total.result(), "ms_per_frame": float(np.mean(times))}
    used = {"network": tdn.network_id, "sensor": sensor.name, "calibration": args.calibration}
    result = {**used, "machine": machine_info(), "sequences": results, "summary": summary}
    return options.conclude(args, result, terminal(depth_table(result)), parts=("perception",))


def _measured(
    tdn: DepthNet, sequence: Sequence, background: np.ndarray, progress: Callable[[int], object]
) -> tuple[DepthQuality, list[float]]:
    """Return the quality on the frames whose penetration is known, and the milliseconds of each."""
    from ..perception.depth_quality import DepthQuality
    from ..speed.timing import CallTimer

    quality, stopwatch = DepthQuality(), CallTimer()
    tdn.predict(sequence.image(sequence.ground_truth_frames[0]), background)  # warm-up, not timed
    for i in sequence.ground_truth_frames:
        image = sequence.image(i)
        with stopwatch:
            predicted = tdn.predict(image, background)
        quality.add(predicted, sequence.penetration_truth(i))
        progress(1)
    return quality, stopwatch.wall_ms
