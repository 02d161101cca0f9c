"""Perception: from tactile images to codes."""

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
    "serial": ("", "Serial number of the DIGIT; empty: the only one, whose captured background is not kept"),
    "background": ("", "No-contact image of this sensor, or a folder of its images; empty: from the first images"),
    "sensor_model": ("", "Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file"),
    "sensor_prefix": ("", "Put before the sensor's frames; for several sensors, e.g. left_"),
}


def generate_launch_description():
    """Declare the arguments, then `start`."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def start(context):
    """Start node `tdn` (`image_raw` to `tactile/points`) and node `tcn` (`tactile/points` to `tactile/code`).

    An argument that is empty leaves its parameter to the files.
    """
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    both = {"use_sim_time": given["use_sim_time"] == "true"}
    if given["autostart"]:
        both["autostart"] = LaunchConfiguration("autostart")
    if given["sensor_model"]:
        both["sensor_model"] = given["sensor_model"]
    of_tdn = {
        name: ParameterValue(LaunchConfiguration(name), value_type=str)
        for name in ("serial", "background")
        if given[name]
    }
    if given["sensor_prefix"]:
        of_tdn["sensor_frame_id"] = given["sensor_prefix"] + "digit_gel_frame"
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad; after a Shutdown the launch would exit with 0
        if not context.is_shutdown and not (respawn and event.returncode != 2):
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        LifecycleNode(
            package="midastouch_perception",
            executable=name,
            name=name,
            namespace=given["namespace"],
            parameters=[*files, both, parameters],
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            respawn=respawn,
            respawn_delay=2.0,
            on_exit=ended,
        )
        for name, parameters in (("tdn", of_tdn), ("tcn", {}))
    ]
