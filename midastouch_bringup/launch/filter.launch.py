"""The filter: from codes and transforms to the pose of the sensor on the object."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

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
    """Start node `particle_filter`. An argument that is empty leaves its parameter to the files."""
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    parameters = {"use_sim_time": given["use_sim_time"] == "true"}
    if given["autostart"]:
        parameters["autostart"] = LaunchConfiguration("autostart")
    if given["seed"]:
        parameters["seed"] = LaunchConfiguration("seed")
    if given["object"]:
        kind = Path(given["sensor_model"]).stem
        kind = "" if kind in ("", "digit_tacto") else f"_{kind}"
        parameters["mesh"] = f"package://midastouch_perception/midastouch_perception/objects/{given['object']}.ply"
        parameters["codebook"] = str(Path(f"out/codebooks/{given['object']}{kind}.npz").resolve())
    for name in ("mesh", "codebook", "objects", "init_mode", "preset", "fingers", "sensor_model"):
        if given[name]:
            parameters[name] = ParameterValue(LaunchConfiguration(name), value_type=str)
    if given["objects"]:  # object and mesh then say only what is simulated
        parameters |= {"mesh": "", "codebook": ""}
    if given["tf_prefix"]:
        parameters["base_frame_id"] = given["tf_prefix"] + "base_link"
    if given["sensor_prefix"]:
        parameters["sensor_frame_id"] = given["sensor_prefix"] + "digit_gel_frame"
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad; after a Shutdown the launch would exit with 0
        if not context.is_shutdown and not (respawn and event.returncode != 2):
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        LifecycleNode(
            package="midastouch_filter",
            executable="particle_filter",
            name="particle_filter",
            namespace=given["namespace"],
            parameters=[*files, parameters],
            remappings=TF,
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            respawn=respawn,
            respawn_delay=2.0,
            on_exit=ended,
        )
    ]
