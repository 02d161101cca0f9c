"""What the launch files of this package are made of: their arguments, and nodes with parameters.

Every argument is described once, in `ARGUMENTS`, and means the same in every launch file. An argument that
stands for a parameter changes it only when it is given; empty leaves what the parameter file says.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import launch.logging
import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node

from midastouch_perception.errors import InputError

from ..parameter_files import merged, read_parameters, written

SHARE = Path(get_package_share_directory("midastouch_bringup"))
_YES_NO = ("true", "false")
_STREAM_NODES = ("tdn", "tcn", "particle_filter")


@dataclass(frozen=True)
class Argument:
    """A launch argument. `sets` names the parameters (node, parameter) it stands for, `kind` their type."""

    description: str
    default: str = ""
    choices: tuple[str, ...] = ()
    sets: tuple[tuple[str, str], ...] = ()
    kind: type = str


ARGUMENTS = {
    # of every launch file
    "namespace": Argument("Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": Argument("Parameters of all nodes", str(SHARE / "config" / "midastouch.yaml")),
    "params_overlay": Argument("Parameter file laid over params_file; may hold only what differs"),
    "use_sim_time": Argument("Take the time from /clock", "false", _YES_NO),
    "use_respawn": Argument("Start a node again 2 s after it died", "false", _YES_NO),
    "log_level": Argument("What the nodes log", "info", ("debug", "info", "warn", "error", "fatal")),
    # sensor
    "serial": Argument(
        "Serial number of the DIGIT; empty: the only one, whose captured background is not kept",
        sets=(("digit_driver", "serial"), ("tdn", "serial")),
    ),
    "autostart": Argument(
        "Activate the driver without a lifecycle manager",
        "true",
        _YES_NO,
        (("digit_driver", "autostart"),),
        bool,
    ),
    # perception and filter
    "background": Argument(
        "No-contact image of this sensor, or a folder of its images; empty: from the first images, or from bag",
        sets=(("tdn", "background"),),
    ),
    "composed": Argument("Run perception and filter in one process", "false", _YES_NO),
    "object": Argument(
        "Name of a bundled object: gives mesh, and codebook from out/codebooks (midastouch build-codebook)"
    ),
    "mesh": Argument("Mesh of the object, metres: a path or package://...", sets=(("particle_filter", "mesh"),)),
    "codebook": Argument("Codebook of that mesh", sets=(("particle_filter", "codebook"),)),
    "init_mode": Argument(
        "Start: over the whole surface, at initial_pose, or once a pose is given",
        choices=("", "uniform", "pose", "wait"),
        sets=(("particle_filter", "init_mode"),),
    ),
    "seed": Argument("Seed of the filter", sets=(("particle_filter", "seed"),), kind=int),
    # arm
    "arm": Argument(
        "Where TF of the arm comes from: already running, the UR ROS driver started here, or ur_tf over RTDE",
        "running",
        ("running", "ur_driver", "rtde"),
    ),
    "robot_ip": Argument("Address of the arm, for arm:=ur_driver and arm:=rtde", sets=(("ur_tf", "robot_ip"),)),
    "ur_type": Argument(
        "Model of the arm, for arm:=ur_driver",
        "ur5e",
        ("ur3", "ur3e", "ur5", "ur5e", "ur7e", "ur10", "ur10e", "ur12e", "ur16e", "ur15", "ur20", "ur30"),
    ),
    "use_mock_hardware": Argument("Mock arm, for arm:=ur_driver", "false", _YES_NO),
    "tf_prefix": Argument(
        "Put before the arm's frames and joints, as in the UR driver", sets=(("ur_tf", "tf_prefix"),)
    ),
    # mount
    "frames_file": Argument("Hand-eye calibration and mount", str(SHARE / "config" / "frames.yaml")),
    "sensor_prefix": Argument("Put before the sensor's frames; for several sensors, e.g. left_"),
    "tool_frame": Argument("Frame the sensor is mounted on, tool0 or tool0_controller; empty: as in frames_file"),
    # recording
    "bag": Argument("YCB-Slide sequence folder, or bag (.mcap file or rosbag2 folder)", sets=(("replay", "source"),)),
    "rate": Argument(
        "Recorded seconds per second; 0: as fast as the filter follows",
        sets=(("replay", "rate"),),
        kind=float,
    ),
    "loop": Argument("Play again and again", "false", _YES_NO, (("replay", "loop"),), bool),
    # view
    "use_rviz": Argument("Start RViz", "true", _YES_NO),
    "rviz_config": Argument("RViz configuration", str(SHARE / "rviz" / "midastouch.rviz")),
}
COMMON = ("namespace", "params_file", "params_overlay", "use_sim_time", "use_respawn", "log_level")


def declare(*names: str, **defaults: str) -> list[DeclareLaunchArgument]:
    """Declarations of the named arguments and of those in `defaults`, which get another default."""
    actions = []
    for name in dict.fromkeys([*names, *defaults]):
        argument = ARGUMENTS[name]
        actions.append(
            DeclareLaunchArgument(
                name,
                default_value=defaults.get(name, argument.default),
                description=argument.description,
                choices=list(argument.choices) or None,
            )
        )
    return actions


def declare_recording(**defaults: str) -> list[DeclareLaunchArgument]:
    """Declarations of what a launch of a recording takes: its own time, and no frame lost."""
    overlay = str(SHARE / "config" / "replay.yaml")
    names = [name for name in COMMON if name not in ("use_sim_time", "params_overlay")]
    names += ["rate", "loop", "composed", "serial", "background", "mesh", "codebook", "init_mode", "seed"]
    names += ["tf_prefix", "sensor_prefix", "use_rviz", "rviz_config"]
    return declare(*names, use_sim_time="true", params_overlay=overlay, **defaults)


def include(name: str, condition=None, **arguments: str) -> IncludeLaunchDescription:
    """Another launch file of this package, with the arguments of the including one, `arguments` over them."""
    source = PythonLaunchDescriptionSource(str(SHARE / "launch" / f"{name}.launch.py"))
    return IncludeLaunchDescription(source, condition=condition, launch_arguments=arguments.items())


def in_turn(processes: list[ExecuteProcess], then: LaunchDescriptionEntity) -> list[LaunchDescriptionEntity]:
    """Run the processes one after the other, then do `then`; end the launch if one of them fails."""
    if not processes:
        return [then]
    handlers = []
    for process, following in zip(processes, [*processes[1:], then], strict=True):

        def go_on(event, _context, following=following):
            return following if event.returncode == 0 else Shutdown(reason=f"{event.process_name} failed")

        handlers.append(RegisterEventHandler(OnProcessExit(target_action=process, on_exit=go_on)))
    return [*handlers, processes[0]]


def start(package: str, executable: str, condition=None) -> OpaqueFunction:
    """One of our nodes (or processes of several), in the namespace, with the merged parameters."""

    def nodes(context: LaunchContext) -> list[LaunchDescriptionEntity]:
        given = context.launch_configurations
        name = "_".join([*filter(None, given["namespace"].split("/")), executable])
        path = Path(launch.logging.launch_config.get_log_file_path(f"{name}.yaml"))
        path.write_text(written(parameters(given), given["namespace"]))
        return [
            Node(
                package=package,
                executable=executable,
                namespace=given["namespace"],
                parameters=[str(path)],
                arguments=["--ros-args", "--log-level", given["log_level"]],
                respawn=given["use_respawn"] == "true",
                respawn_delay=2.0,
                output="screen",
            )
        ]

    return OpaqueFunction(function=nodes, condition=condition)


def parameters(given: dict[str, str]) -> dict[str, dict]:
    """Parameters by node: params_file, params_overlay over it, and the launch arguments over both."""
    files = [read_parameters(given[name]) for name in ("params_file", "params_overlay") if given.get(name)]
    overrides: dict[str, dict] = {}
    for name, argument in ARGUMENTS.items():
        if given.get(name):
            value = given[name] if argument.kind is str else argument.kind(yaml.safe_load(given[name]))
            for node, parameter in argument.sets:
                overrides.setdefault(node, {})[parameter] = value
    for node in _STREAM_NODES:
        overrides.setdefault(node, {})["use_sim_time"] = given["use_sim_time"] == "true"
    if given.get("object"):
        # here: `--show-args` need not wait for the mesh libraries
        from midastouch_perception.objects import bundled_objects

        from ..codebooks import codebook_path

        objects, found = bundled_objects(), overrides["particle_filter"]
        if given["object"] not in objects:
            raise InputError(
                f"object:={given['object']}: not bundled; there are {', '.join(objects)}; for another give mesh:= "
                "and codebook:="
            )
        found.setdefault("mesh", str(objects[given["object"]]))
        found.setdefault("codebook", str(codebook_path(given["object"]).resolve()))
    if given.get("bag") and not given.get("background"):
        overrides["tdn"] |= _background_of(Path(given["bag"]))
    if given.get("tf_prefix"):
        overrides["particle_filter"]["base_frame_id"] = f"{given['tf_prefix']}base_link"
    if prefix := given.get("sensor_prefix"):
        overrides.setdefault("digit_driver", {})["frame_id"] = f"{prefix}digit_optical_frame"
        for node in ("tdn", "particle_filter"):
            overrides[node]["sensor_frame_id"] = f"{prefix}digit_gel_frame"
    return merged([*files, overrides])


def _background_of(recording: Path) -> dict[str, str]:
    """Where a sequence folder holds the sensor's no-contact image, else the images to estimate it from."""
    for inside in ("background.png", "tactile_images", "frames"):
        if (recording / inside).exists():
            return {"background": str((recording / inside).resolve())}
    return {}
