"""A simulated finger or arm explores an object by itself, until the filter knows its pose. No hardware, no data.

The first run makes codebooks under out/. `midastouch run explore` does the same, takes keys and ends with a page.
"""

import subprocess
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable, EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

SHARE = get_package_share_directory("midastouch_bringup")
WORDS = ["true", "false"], ["finger", "mujoco"]
REACH = "ROS_AUTOMATIC_DISCOVERY_RANGE"  # this machine alone, unless the user has chosen otherwise
ARM = LaunchConfiguration("arm")
ARGUMENTS = {
    "arm": ("finger", "What moves the sensor: finger (no mechanics), or mujoco (a UR in MuJoCo)"),
    "setup_file": ([SHARE, "/config/explore_", ARM, ".yaml"], "What this launch file itself changes in params_file"),
    "use_sim_time": (EqualsSubstitution(ARM, "mujoco"), "Take the time from /clock"),
    "object": ("star_knob", "Bundled object: gives mesh, and codebook from out/cache/codebooks"),
    "mesh": ("", "Mesh of the object, metres: a path or package://..."),
    "codebook": ("", "Codebook of that mesh; empty: one is made"),
    "objects": ("ball,eyebolt,handle_tool,star_knob", "Objects it may be besides, for the filter, separated by ','"),
    "seed": ("2", "Seed of the filter and of the simulation; with some it gives up"),
    "start_paused": ("false", "The explorer waits for ~/resume"),
    "prepare": ("true", "Make the codebooks that are missing first"),
    "use_rviz": ("true", "Start RViz"),
    "rviz_config": (f"{SHARE}/rviz/explore.rviz", "RViz configuration"),
}


def generate_launch_description():
    """Make missing codebooks, then start `digit_sim`, the localisation, the simulated finger or arm, and `explorer`."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=next((c for c in WORDS if v in c), None))
        for name, (v, text) in ARGUMENTS.items()
    ]
    rviz = PythonLaunchDescriptionSource(f"{SHARE}/launch/rviz.launch.py")
    actions = [
        SetEnvironmentVariable(REACH, EnvironmentVariable(REACH, default_value="LOCALHOST")),
        OpaqueFunction(function=prepare),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(f"{SHARE}/launch/digit_sim.launch.py")),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(f"{SHARE}/launch/localization.launch.py")),
        IncludeLaunchDescription(rviz, condition=IfCondition(LaunchConfiguration("use_rviz"))),
        OpaqueFunction(function=start),
    ]
    return LaunchDescription([*declared, *actions])


def prepare(context):
    """Make missing codebooks by the command; replace names of objects by files, the explored one among `objects`."""
    given, quick = context.launch_configurations, "out/cache/codebooks/{}_10000.npz"
    if given["prepare"] == "true":
        midastouch = ExecutableInPackage("midastouch", "midastouch_tools").perform(context)
        words = [f"{name}:={given[name]}" for name in ("arm", "object", "mesh", "codebook", "objects")]
        subprocess.run([midastouch, "run", "explore", *words, "--prepare"], check=True)
    if not given["mesh"]:
        given["mesh"] = f"package://midastouch_perception/midastouch_perception/objects/{given['object']}.ply"
    name = Path(given["mesh"]).stem
    given["codebook"] = given["codebook"] or str(Path(quick.format(name)).resolve())
    others = [one.strip() for one in given["objects"].split(",") if one.strip() not in ("", name)]
    books = [one if "." in one or "/" in one else str(Path(quick.format(one)).resolve()) for one in others]
    given["objects"] = ",".join([*books, given["codebook"]]) if books else ""


def start(context):
    """Start what moves the sensor, and `explorer`; the others stay once it has ended well."""
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    frames = {"base_frame_id": given["tf_prefix"] + "base_link"} if given["tf_prefix"] else {}
    frames |= {"sensor_frame_id": given["sensor_prefix"] + "digit_gel_frame"} if given["sensor_prefix"] else {}
    timed, touching = {"use_sim_time": given["use_sim_time"] == "true", **frames}, {"mesh": given["mesh"], **frames}
    seed, paused = {"seed": int(given["seed"])}, {"start_paused": given["start_paused"] == "true"}
    explorer = ("midastouch_motion", "explorer", timed | touching | seed | paused)
    finger = [("midastouch_simulation", "simulated_finger", touching | seed)]
    mujoco = [("midastouch_simulation", "mujoco_arm", touching), ("midastouch_motion", "contact_controller", timed)]
    nodes = [explorer, *(finger if given["arm"] == "finger" else mujoco)]

    def ended(event, context):
        if event.returncode and not context.is_shutdown:
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        Node(
            package=package,
            executable=executable,
            namespace=given["namespace"],
            parameters=[*files, parameters],
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            on_exit=ended,
        )
        for package, executable, parameters in nodes
    ]
