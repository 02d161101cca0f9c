"""Perception and filter in one process."""

import atexit
import tempfile
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": (f"{SHARE}/config/midastouch.yaml", "Parameters of all nodes"),
    "setup_file": ("", "What this launch file itself changes in params_file"),
    "params_overlay": ("", "Parameter file of yours, over both; it may hold only what differs"),
    "use_respawn": ("false", "Start a node again after it died"),
    "log_level": ("info", "What the nodes log: debug, info, warn, error or fatal"),
    "use_sim_time": ("false", "Take the time from /clock"),
    "autostart": ("", "Whether lifecycle nodes configure and activate by themselves; empty: as in params_file"),
    "serial": ("", "Serial number of the DIGIT; empty: the only one, whose captured background is not kept"),
    "background": ("", "No-contact image of this sensor, or a folder of its images; empty: from the first images"),
    "object": ("", "Bundled object: gives mesh, and codebook from out/codebooks (midastouch build-codebook)"),
    "mesh": ("", "Mesh of the object, metres: a path or package://..."),
    "codebook": ("", "Codebook of that mesh; empty: a coarse one is built"),
    "objects": ("", "Objects it may be: bundled ones, codebooks, meshes, folders of them, separated by ','"),
    "init_mode": ("", "Start: uniform over the surface, pose (at initial_pose), or wait for a pose"),
    "preset": ("", "Filter settings between run time and error: fast, balanced or paper"),
    "fingers": ("", "Further sensors on the same object, NAMESPACE:GEL_FRAME separated by ','"),
    "seed": ("", "Seed of the filter and of the simulation"),
    "sensor_model": ("", "Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file"),
    "tf_prefix": ("", "Put before the arm's frames and joints, as in the UR driver"),
    "sensor_prefix": ("", "Put before the sensor's frames; for several sensors, e.g. left_"),
}
# TF of the whole robot; ("/tf", "tf") is that of the namespace alone
TF = [("/tf", "/tf"), ("/tf_static", "/tf_static")]


def generate_launch_description():
    """Declare the arguments, then `start`."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def start(context):
    """Start `all_in_one`: `tdn`, `tcn` and `particle_filter`. An empty argument leaves its parameter to the files."""
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    all_three = {"use_sim_time": given["use_sim_time"] == "true"}
    if given["autostart"]:
        all_three["autostart"] = yaml.safe_load(given["autostart"])
    if given["sensor_model"]:
        all_three["sensor_model"] = given["sensor_model"]
    of_tdn = {name: given[name] for name in ("serial", "background") if given[name]}
    parameters = {"seed": int(given["seed"])} if given["seed"] else {}
    if given["object"]:
        kind = Path(given["sensor_model"]).stem
        kind = "" if kind in ("", "digit_tacto") else f"_{kind}"
        parameters["mesh"] = f"package://midastouch_perception/midastouch_perception/objects/{given['object']}.ply"
        parameters["codebook"] = str(Path(f"out/codebooks/{given['object']}{kind}.npz").resolve())
    own = ("mesh", "codebook", "objects", "init_mode", "preset", "fingers")
    parameters |= {name: given[name] for name in own if given[name]}
    if given["objects"]:  # object and mesh then say only what is simulated
        parameters |= {"mesh": "", "codebook": ""}
    if given["tf_prefix"]:
        parameters["base_frame_id"] = given["tf_prefix"] + "base_link"
    if given["sensor_prefix"]:
        of_tdn["sensor_frame_id"] = parameters["sensor_frame_id"] = given["sensor_prefix"] + "digit_gel_frame"
    # a name given to the process would be that of all its nodes, and so a dictionary here would be for all of them
    nodes = {"tdn": all_three | of_tdn, "tcn": all_three, "particle_filter": all_three | parameters}
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
        yaml.safe_dump({f"/**/{name}": {"ros__parameters": {**values}} for name, values in nodes.items()}, file)
    atexit.register(Path(file.name).unlink, missing_ok=True)
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad; after a Shutdown the launch would exit with 0
        if not context.is_shutdown and not (respawn and event.returncode != 2):
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        Node(
            package="midastouch_bringup",
            executable="all_in_one",
            namespace=given["namespace"],
            parameters=[*files, file.name],
            remappings=TF,
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            respawn=respawn,
            respawn_delay=2.0,
            on_exit=ended,
        )
    ]
