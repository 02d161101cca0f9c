"""`midastouch evaluate-tdn`: the depth network against known penetration maps."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from . import arguments, outcome

if TYPE_CHECKING:
    import numpy as np

    from midastouch_perception.tdn import DepthNet

    from ..datasets import Sequence
    from ..evaluation.perception.depth_quality import DepthQuality


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
    parser.add_argument(
        "--background", metavar="IMAGE", help="no-contact image of the sensor (default: the sequence's)"
    )
    parser.add_argument("--tdn", default="fast", metavar="NET", help="depth network, name or file (default fast)")
    outcome.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    import numpy as np

    from midastouch_perception.errors import InputError
    from midastouch_perception.tdn import load_tdn

    from ..datasets import load_sequence
    from ..datasets.sequence import read_image
    from ..evaluation.machine import machine_info
    from ..evaluation.perception.depth_quality import DepthQuality
    from ..evaluation.setup import sequence_background
    from ..evaluation.table import number, text_table
    from ..progress import progress_bar

    sequences = [load_sequence(path) for path in args.sequences]
    given = read_image(Path(args.background)) if args.background else None
    for sequence in sequences:
        if not sequence.ground_truth_frames:
            raise InputError(f"{sequence.path}: no ground truth (gt_heightmaps); only simulated sequences have it")
    tdn = load_tdn(args.tdn)
    total, results, times = DepthQuality(), [], []
    with progress_bar(total=sum(len(s.ground_truth_frames) for s in sequences), unit="frame") as bar:
        for sequence in sequences:
            bar.set_description(sequence.name)
            background, source = (given, args.background) if args.background else sequence_background(sequence)
            quality, ms = _measured(tdn, sequence, background, bar.update)
            total.merge(quality)
            times += ms
            mean = {"ms_per_frame": float(np.mean(ms)), "background": source}
            results.append({"sequence": sequence.name, **quality.result(), **mean})
    summary = {**total.result(), "ms_per_frame": float(np.mean(times))}
    result = {"network": tdn.network_id, "machine": machine_info(), "sequences": results, "summary": summary}
    keys = ("rmse_mm", "contact_rmse_mm", "contact_iou", "ms_per_frame")
    rows = [[r["sequence"], r["frames"], *(number(r[k], 3) for k in keys)] for r in results]
    rows.append(["all", summary["frames"], *(number(summary[k], 3) for k in keys)])
    header = ["sequence", "frames", "RMSE mm", "in contact mm", "contact IoU", "ms/frame"]
    return outcome.conclude(args, result, text_table(header, rows))


def _measured(
    tdn: DepthNet, sequence: Sequence, background: np.ndarray, progress: Callable[[int], object]
) -> tuple[DepthQuality, list[float]]:
    """Quality on the frames whose penetration is known, and the milliseconds of each."""
    from ..evaluation.perception.depth_quality import DepthQuality
    from ..evaluation.speed.timing import Stopwatch

    quality, stopwatch = DepthQuality(), Stopwatch()
    tdn.predict(sequence.image(sequence.ground_truth_frames[0]), background)  # warm-up, not timed
    for i in sequence.ground_truth_frames:
        image = sequence.image(i)
        with stopwatch:
            predicted = tdn.predict(image, background)
        quality.add(predicted, sequence.penetration_truth(i))
        progress(1)
    return quality, stopwatch.wall_ms
