"""`midastouch view`: the running nodes, live in a browser; or a finished run, there or as files of clouds."""

from __future__ import annotations

import argparse
import sys

from midastouch_common.missing_modules import install_extra

from . import arguments, limits


def add_parser(subparsers) -> None:
    """Add the sub-command."""
    parser = arguments.add_command(
        subparsers,
        "view",
        run,
        "show the running nodes, or a finished run: object, particles, modes, contact, image, truth, which object",
        "midastouch view --namespace left --save out/left.rrd\n"
        "  midastouch view out/demo/run.mcap\n"
        "  midastouch view out/drill.json --export out/drill",
        "Listens to the nodes over DDS (same ROS_DOMAIN_ID), or reads a bag with results or a result of\n"
        "`midastouch evaluate`, and serves a page to this machine only, unless --host says otherwise.\n"
        "On another computer: ssh -L 9090:127.0.0.1:9090 -L 9876:127.0.0.1:9876 ROBOT.\n"
        f"Needs Rerun: {install_extra('view')}; --export needs Open3D: {install_extra('open3d')}.\n"
        "Its page is Rerun's: it sends no data away, but may ask for Rerun's newest version and a font.",
    )
    parser.add_argument("run_or_bag", metavar="RUN_OR_BAG", nargs="?", help="a finished run (default: what runs)")
    arguments.add_name(parser, "--namespace", "namespace", "of the nodes")
    parser.add_argument("--rate", type=limits.drawings_per_s, default=2.0, help="drawings per second (default 2)")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve; 0.0.0.0: to all (default 127.0.0.1)")
    parser.add_argument("--port", type=limits.port, default=9876, help="of the data (default 9876)")
    parser.add_argument("--web-port", type=limits.port, default=9090, help="of the page (default 9090)")
    arguments.add_place(parser, "--save", "file", "record to a file instead of serving", metavar="FILE.rrd")
    finished = parser.add_argument_group("a finished run")
    finished.add_argument("--mesh", help="file or bundled object (default: the run's)")
    finished.add_argument("--sequence", help="of a JSON file with several")
    finished.add_argument("--sensor", default="digit_tacto", help="sensor model (default digit_tacto)")
    arguments.add_place(finished, "--export", "folder", "write mesh, clouds and lines as PLY, and show nothing")


def run(args: argparse.Namespace) -> int:
    """Carry out the command."""
    import contextlib

    from midastouch_common.errors import InputError
    from midastouch_common.files import atomic_path

    from ..view import require_rerun

    if args.export and not args.run_or_bag:
        raise InputError("--export writes a finished run; name its bag or its result")
    finished = _finished(args) if args.run_or_bag else None
    if args.export:
        return _export(args.export, *finished)
    rerun = require_rerun()
    from ..view.scene import Scene
    from ..view.server import ViewServer

    batches = rerun.ChunkBatcherConfig(flush_tick=1.0)  # few, large ones: a browser without a GPU takes few per second
    recording = rerun.RecordingStream("midastouch", batcher_config=batches)
    with contextlib.ExitStack() as stack:
        if args.save:
            recording.save(stack.enter_context(atomic_path(args.save)))
            print(f"{args.save}: once this has ended, open it with: rerun {args.save}", flush=True)
        else:
            memory_mb = 500 if finished else 30  # live, a browser reads all history before any news
            server = stack.enter_context(ViewServer(args.host, args.port, args.web_port, memory_mb))
            recording.connect_grpc(server.address)
            print(f"open {server.page}", flush=True)
        stack.callback(recording.disconnect)
        scene = Scene(recording)
        if not finished:
            from midastouch_common.ros import spin

            from ..nodes.view import View

            return spin.run(lambda: [View(scene)], arguments.ros_arguments("view", {"rate": args.rate}, args.namespace))
        from midastouch_common.stop_signals import stop_event

        from ..view.finished_run import draw

        with stop_event(lambda: None) as stopped:
            draw(finished[0], finished[1], scene, recording)
            recording.flush()
            if not args.save:
                stopped.wait()
    return 0


def _finished(args: argparse.Namespace) -> tuple:
    """Return the run and the mesh of its object."""
    from midastouch_common.errors import InputError

    from ..bags.reader import bag_metadata
    from ..datasets.loading import is_bag
    from ..view.finished_run import load

    if not args.mesh and is_bag(args.run_or_bag) and not bag_metadata(args.run_or_bag).get("object"):
        raise InputError(f"{args.run_or_bag}: does not name its object; give its --mesh")
    print(f"reading {args.run_or_bag}", file=sys.stderr)
    read = load(args.run_or_bag, args.sequence, args.sensor)
    return read, arguments.load_mesh(args.mesh or read.mesh)


def _export(path: str, finished, mesh) -> int:
    """Write a run to a new folder."""
    from midastouch_common.files import atomic_path, require_new_folder

    from ..view import clouds, require_open3d

    require_new_folder(path)
    require_open3d()
    with atomic_path(path) as folder:
        folder.mkdir()
        files = clouds.export(finished, mesh, folder)
    print(f"{path}: {files} files")
    return 0
