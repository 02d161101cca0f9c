"""`midastouch view`: the state of the running nodes, live in a browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from midastouch_common.missing_modules import install_extra

from . import arguments


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "view",
        run,
        "show the running nodes in a browser: object, particles, modes, contact, image, truth, which object",
        "midastouch view --namespace left --save out/left.rrd",
        "Listens to the nodes over DDS (same ROS_DOMAIN_ID) and serves a page to this machine only, unless\n"
        "--host says otherwise. On another computer: ssh -L 9090:127.0.0.1:9090 -L 9876:127.0.0.1:9876 ROBOT.\n"
        f"Needs Rerun: {install_extra('view')}.\n"
        "Its page is Rerun's: it sends no data away, but may ask for Rerun's newest version and a font.",
    )
    parser.add_argument("--namespace", default="", help="of the nodes (default: none)")
    parser.add_argument("--rate", type=arguments.positive, default=5.0, help="drawings per second (default 5)")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve; 0.0.0.0: to all (default 127.0.0.1)")
    parser.add_argument("--port", type=arguments.port, default=9876, help="of the data (default 9876)")
    parser.add_argument("--web-port", type=arguments.port, default=9090, help="of the page (default 9090)")
    parser.add_argument("--memory", type=arguments.positive_int, default=500, help="history kept, MB (default 500)")
    parser.add_argument("--save", metavar="FILE.rrd", help="record to a file instead of serving")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import contextlib

    from midastouch_common.errors import InputError
    from midastouch_common.files import atomic_path

    from ..view import require_rerun
    from ..view.scene import Scene
    from ..view.server import ViewServer

    rerun = require_rerun()
    if args.save and Path(args.save).is_dir():
        raise InputError(f"--save {args.save}: is a folder; name a file, such as {Path(args.save) / 'run.rrd'}")
    from midastouch_common.ros import spin

    from ..nodes.view import View

    recording = rerun.RecordingStream("midastouch")
    ros_arguments = ["view", "--ros-args", "-p", f"rate:={args.rate}"]
    if args.namespace:
        ros_arguments += ["-r", f"__ns:=/{args.namespace.strip('/')}"]
    with contextlib.ExitStack() as stack:
        if args.save:
            recording.save(stack.enter_context(atomic_path(args.save)))
        else:
            server = stack.enter_context(ViewServer(args.host, args.port, args.web_port, args.memory))
            recording.connect_grpc(server.address)
            print(f"open {server.page}", flush=True)
        stack.callback(recording.disconnect)
        return spin.run(lambda: [View(Scene(recording))], ros_arguments)
