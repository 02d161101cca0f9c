"""`midastouch store-mount`: keep what sliding has taught about the mount and the clock."""

from __future__ import annotations

import argparse

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "store-mount",
        run,
        "write the mount that the running filter has learnt while sliding, for the next launch",
        "midastouch store-mount --out frames.yaml",
        "Reads the topic calibration of a running particle_filter, and writes a copy of the frames file in use whose\n"
        "hand_eye is corrected: give it to the next launch as frames_file:=FILE. Slide over edges first, and turn the\n"
        "sensor. What no touch has told yet is named, and stays nearly as it was.",
    )
    parser.add_argument("--out", metavar="FILE", required=True, help="the corrected frames file (YAML)")
    parser.add_argument(
        "--frames",
        metavar="FILE",
        help="the frames file that the filter was started with (default: config/frames.yaml, if --out is new)",
    )
    parser.add_argument("--namespace", default="", metavar="NAME", help="of the filter (default: none)")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    from pathlib import Path

    import numpy as np

    from midastouch_common import se3
    from midastouch_common.errors import InputError
    from midastouch_common.message_arrays import pose_from_msg

    from ..arm.mount import correct_mount
    from ..ros.launch_arguments import SHARE
    from ..ros.local_context import learnt_calibration

    if not args.frames and Path(args.out).exists():  # what is learnt is relative to the file of the last launch
        raise InputError(
            f"{args.out}: exists; say which file the filter was started with: --frames {args.out}, or --frames "
            f"{SHARE / 'config' / 'frames.yaml'}"
        )
    learnt = learnt_calibration(args.namespace)
    known = list(learnt.known)
    if not any(known):
        raise InputError("calibration: nothing is known yet; slide over edges, and turn the sensor while it touches")
    frames = args.frames or SHARE / "config" / "frames.yaml"
    if any(known[:6]):
        change = correct_mount(frames, args.out, pose_from_msg(learnt.mount.pose))
        distance, angle = 1e3 * np.linalg.norm(change[:3, 3]), np.degrees(se3.rotation_angle(change[:3, :3]))
        print(f"{args.out}: the sensor is mounted {distance:.1f} mm, {angle:.1f} deg off what {frames} says")
    axes = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z", "clock")
    if missing := [name for name, is_known in zip(axes, known, strict=True) if not is_known]:
        print(f"not known yet, of the gel frame: {', '.join(missing)}")
    if known[6]:
        print(
            f"the arm's poses are {1e3 * learnt.clock_offset:.0f} ms late; "
            f"add {round(1e9 * learnt.clock_offset)} to the parameter timestamp_offset of digit_driver"
        )
    return 0
