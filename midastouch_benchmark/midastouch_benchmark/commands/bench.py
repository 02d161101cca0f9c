"""`midastouch bench`: milliseconds per stage, Hz end to end, memory."""

from __future__ import annotations

import argparse

from midastouch_bringup.commands import arguments

from . import options, outcome
from .timed_slide import TimedSlide


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "bench",
        run,
        "measure the speed of every stage and of the whole pipeline on this machine",
        "midastouch bench --json out/bench.json",
        "On a bundled object, whose codebook is built first and kept in out/. CPU time per call is given\n"
        "beside wall time: it is the figure that holds on a busy machine.",
    )
    parser.add_argument("--object", default="handle_tool", help="bundled object (default handle_tool)")
    parser.add_argument("--codebook-size", type=arguments.positive_int, default=50_000, help="default 50000")
    parser.add_argument("--frames", type=arguments.positive_int, default=150, help="of the slide (default 150)")
    options.add_network_options(parser)
    parser.add_argument(
        "--paper-networks",
        action="store_true",
        help="also time the paper's networks, FCRN and MinkLoc3D (with random weights: speed does not depend on them)",
    )
    outcome.add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from midastouch_bringup.codebooks import cached_codebook, cached_codebook_path
    from midastouch_bringup.progress import progress_bar
    from midastouch_bringup.result_file import to_json

    from ..ros.pose_age import pose_age
    from ..speed.memory import peak_rss_mb
    from ..speed.node_start import node_start
    from ..speed.stages import SpeedMeasurement

    slide = TimedSlide.of(args)
    mesh, networks = slide.mesh, slide.networks
    codebook = cached_codebook(mesh, networks.tcn, networks.sensor, args.codebook_size)
    speed = SpeedMeasurement(mesh, codebook, slide.sequence, networks)
    result = slide.result(codebook_size=len(codebook.poses), frames=args.frames)
    stages = (
        speed.networks,
        speed.filter,
        speed.lookup,
        speed.end_to_end,
        speed.four_modes,
        lambda: pose_age(speed.stepper()),
        lambda: node_start(mesh.path, cached_codebook_path(mesh, args.codebook_size)),
        speed.simulator,
    )
    for stage in progress_bar(iterable=stages, unit="stage"):
        result |= stage()
    result["peak_rss_mb"] = peak_rss_mb()
    if args.paper_networks:  # last, for they need more memory than all else
        result |= speed.paper_networks()
    result = to_json(result)
    return outcome.conclude(args, result, _table(result))


def _table(result: dict) -> str:
    from midastouch_bringup.text_table import number, text_table

    rows = []
    for key, label in (
        ("tdn_ms", "TDN"),
        ("tcn_ms", "TCN"),
        ("fit_check_ms", "fit check, every fifth frame"),
        ("fcrn_ms", "the paper's TDN (FCRN)"),
        ("minkloc3d_ms", "the paper's TCN (MinkLoc3D)"),
        ("end_to_end_ms", "image to estimate, 50,000 particles"),
        ("frame_ms", "image to the end of the frame, 50,000 particles"),
        ("four_modes_ms", "filter step, four modes aligned"),
        ("pose_age_ms", "age of an image when its transform is found, 500 Hz of 20 links"),
    ):
        if key in result:
            rows.append([label, *_cells(result[key])])
    for light, stage in result["sim_image_ms"].items():
        rows.append([f"simulated image, light {light}", *_cells(stage)])
    for key, label in (
        ("filter_ms", "filter step without fine stage"),
        ("fine_stage_ms", "fine stage"),
        ("lookup_ms", "look-up, spread"),
        ("lookup_converged_ms", "look-up, converged"),
    ):
        rows += [[f"{label}, {int(n):,} particles", *_cells(stage)] for n, stage in result[key].items()]
    if "converged_ms" in result:
        rows.append(["image to estimate, converged", *_cells(result["converged_ms"])])
        rows.append(["image to the end of the frame, converged", *_cells(result["converged_frame_ms"])])
    rates = [
        f"{number(result['end_to_end_hz'])} Hz with 50,000 particles",
        f"{number(result.get('converged_hz'))} Hz once converged",
        *(f"{100 * share:.2f} % exact look-ups ({name})" for name, share in result["lookup_exact_share"].items()),
        f"{number(result['renders_per_s'], 0)} renders/s",
        f"{number(result['codebook_poses_per_s'], 0)} codebook poses/s",
        f"{number(result['peak_rss_mb'], 0)} MiB at most",
        f"the filter's process active after {result['filter_start_s']['p50']:.1f} s"
        f" with {number(result['filter_rss_mb'], 0)} MiB",
    ]
    return text_table(["ms", "p50", "p95", "CPU"], rows) + "\n" + ", ".join(rates)


def _cells(stage: dict) -> list[str]:
    return [f"{stage[key]:.2f}" if key in stage else "" for key in ("p50", "p95", "cpu")]
