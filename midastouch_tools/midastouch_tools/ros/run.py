"""Launch files without `ros2 launch`: what they need made first, then carried out."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from midastouch_common.errors import InputError
from midastouch_common.files import whole_folder
from midastouch_common.frames import BASE_FRAME, GEL_FRAME
from midastouch_common.output_paths import SIMULATED, exploration
from midastouch_common.ros.addresses import load_mesh
from midastouch_perception.mesh_report import MeshReport
from midastouch_perception.objects import bundled_mesh
from midastouch_perception.sensor_model import SensorModel

from ..demo.preparation import prepare_codebooks, prepare_slide, quick_codebooks, require_built, require_there
from ..processes.local_domain import own_domain
from ..replay.source import ReplaySource, parsed_remaps
from . import launch_file


def run_setup(name: str, words: Sequence[str]) -> int:
    """Carry out a launch file until its nodes have ended or a signal comes; returns the exit status.

    words: arguments as `ros2 launch` takes them; RViz is started only if it is asked for. Raises InputError for invalid
    arguments, before anything is made, and for nodes that are not installed.
    """
    given = launch_file.values(name, words)
    if "use_rviz" in given and not any(word.startswith("use_rviz:=") for word in words):
        given["use_rviz"] = "false"
    if given.get("mesh") and any(word.startswith("object:=") for word in words):
        raise InputError("object and mesh are both given; give one of them, as each names what is touched")
    print(f"[midastouch] starting {name}: each node reports once it has loaded", flush=True)
    prepare(name, given)
    if name == "explore":
        return _explore(given)
    if given.get("bag") and name == "replay":
        _say_if_no_pose(given)
    if name == "demo":
        # hides the demo's nodes from the rest of the network, unless the user has chosen otherwise
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        given["prepare"] = "false"
    return launch_file.carry_out(name, given)


def prepare(name: str, given: dict[str, str]) -> None:
    """Make the files that a launch file still lacks in the current folder; only `demo` and `explore` need any.

    Of a mesh without a codebook the report is printed, as `midastouch build-codebook` does. Raises InputError before
    anything is made: for named files that do not exist, meshes that cannot be used, and objects that are not bundled or
    whose codebook is not built.
    """
    require_there(given)
    if name == "demo":
        prepare_slide(given["object"], bundled_mesh(given["object"]))
    elif name == "explore":
        if given["namespace"]:
            raise InputError("namespace: midastouch run explore draws without one; ros2 launch takes it")
        if given["arm"] == "mujoco":
            from midastouch_simulation.mujoco_arm import require_mujoco

            require_mujoco()
        prepare_codebooks(quick_codebooks(given))
    else:
        if "init_mode" in given:  # there is a filter
            require_built(given)
        if given.get("mesh") and not given.get("codebook"):
            sensor = SensorModel.load(given.get("sensor_model") or SIMULATED)
            MeshReport.tell(load_mesh(given["mesh"]), sensor, lambda line: print(line, file=sys.stderr))


def _say_if_no_pose(given: dict[str, str]) -> None:
    """Say what a recording lacks to give poses, with the fix. Raises InputError for one that cannot be played."""
    print(f"[midastouch] reading {given['bag']}", flush=True)
    of_filter = launch_file.parameters(given).get("particle_filter", {})
    base = given["tf_prefix"] + BASE_FRAME if given["tf_prefix"] else of_filter.get("base_frame_id", BASE_FRAME)
    gel = given["sensor_prefix"] + GEL_FRAME if given["sensor_prefix"] else of_filter.get("sensor_frame_id", GEL_FRAME)
    remaps, rotation = parsed_remaps(given["remap"].split()), int(given["rotation"])
    if missing := ReplaySource(given["bag"], remaps=remaps, rotation=rotation).pose_missing(base, gel):
        print(f"[midastouch] WARNING: {missing}", flush=True)


def _explore(given: dict[str, str]) -> int:
    """Run the exploration: recorded, with keys for a person, and with a page."""
    from .explore import RECORDING, run_exploration

    out = exploration()
    given |= {"prepare": "false", "start_paused": "true"}
    try:
        with whole_folder(out, keep_failed=True) as fresh:
            programs = launch_file.programs("explore", given, fresh / "parameters")
            status = run_exploration(programs, given, fresh, own_domain())
    except KeyboardInterrupt:
        print(f"nothing of this run is kept; {out} is as it was before", file=sys.stderr)
        raise
    print(f"pictures and table: {out / 'index.html'}\nrecording: {out / RECORDING}")
    return status
