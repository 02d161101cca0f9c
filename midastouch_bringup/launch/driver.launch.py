"""The DIGIT's driver."""

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
    "autostart": ("", "Whether lifecycle nodes configure and activate by themselves; empty: as in params_file"),
    "serial": ("", "Serial number of the DIGIT; empty: the only one, whose captured background is not kept"),
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
    """Start node `digit_driver`. An argument that is empty leaves its parameter to the files."""
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    parameters = {}
    if given["autostart"]:
        parameters["autostart"] = LaunchConfiguration("autostart")
    if given["serial"]:
        parameters["serial"] = ParameterValue(LaunchConfiguration("serial"), value_type=str)
    if given["sensor_prefix"]:
        parameters["frame_id"] = given["sensor_prefix"] + "digit_optical_frame"
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad; after a Shutdown the launch would exit with 0
        if not context.is_shutdown and not (respawn and event.returncode != 2):
            raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    return [
        LifecycleNode(
            package="digit_driver",
            executable="digit_driver",
            name="digit_driver",
            namespace=given["namespace"],
            parameters=[*files, parameters],
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            respawn=respawn,
            respawn_delay=2.0,
            on_exit=ended,
        )
    ]
