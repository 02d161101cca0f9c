"""A DIGIT on a UR arm that touches an object by itself, until the filter knows its pose.

It moves only while `contact_controller/enable` is repeated, and explores once `explorer/resume` is called. Each run is
recorded.
"""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = get_package_share_directory("midastouch_bringup")
YES_NO = ["true", "false"]
UR_WRENCH = "/force_torque_sensor_broadcaster/wrench"
ARGUMENTS = {
    "namespace": ("", "Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": (f"{SHARE}/config/midastouch.yaml", "Parameters of all nodes"),
    "setup_file": (f"{SHARE}/config/explore_ur.yaml", "What this launch file itself changes in params_file"),
    "params_overlay": ("", "Parameter file of yours, over both; it may hold only what differs"),
    "use_respawn": ("false", "Start a node again after it died"),
    "log_level": ("info", "What the nodes log: debug, info, warn, error or fatal"),
    "use_sim_time": ("false", "Take the time from /clock"),
    "arm": ("running", "TF and motion of the arm: of one that runs already (running), or by RTDE (rtde)"),
    "tcp_offset": ("", "With arm:=rtde: tool centre point on the teach pendant, [x, y, z, rx, ry, rz], m and rad"),
    "sensor_model": ("digit_real", "Kind of the sensor: digit_real, gelsight_mini, or a YAML file"),
    "record": ("out/explore_ur/%Y-%m-%d_%H-%M-%S.mcap", "Bag that the run is recorded into"),
}


def generate_launch_description():
    """Start the nodes of `live_ur`, `contact_controller`, `recorder`, `explorer`, and with arm:=rtde `ur_speed`."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=YES_NO if v in YES_NO else None)
        for name, (v, text) in ARGUMENTS.items()
    ]
    live_ur = PythonLaunchDescriptionSource(f"{SHARE}/launch/live_ur.launch.py")
    return LaunchDescription([*declared, IncludeLaunchDescription(live_ur), OpaqueFunction(function=start)])


def start(context):
    """Start the nodes that are not in `live_ur`. An argument that is empty leaves its parameter to the files."""
    given = context.launch_configurations
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    moving = {"use_sim_time": given["use_sim_time"] == "true"}
    moving |= {"base_frame_id": given["tf_prefix"] + "base_link"} if given["tf_prefix"] else {}
    gel = {"sensor_frame_id": given["sensor_prefix"] + "digit_gel_frame"} if given["sensor_prefix"] else {}
    lifecycle = {"autostart": LaunchConfiguration("autostart")} if given["autostart"] else {}
    explorer = {**moving, **gel}
    if given["object"]:
        explorer["mesh"] = f"package://midastouch_perception/midastouch_perception/objects/{given['object']}.ply"
    if given["mesh"]:
        explorer["mesh"] = ParameterValue(LaunchConfiguration("mesh"), value_type=str)
    if given["seed"]:
        explorer["seed"] = LaunchConfiguration("seed")
    controller = {**moving, **gel, **lifecycle, "sensor_model": given["sensor_model"]}
    tool = {"tool_frame_id": given["tf_prefix"] + "tool0", "tcp_offset": LaunchConfiguration("tcp_offset")}
    nodes = [
        (LifecycleNode, "midastouch_motion", "contact_controller", controller),
        (Node, "midastouch_tools", "recorder", {"path": given["record"]}),
        (Node, "midastouch_motion", "explorer", explorer),
    ]
    if given["arm"] == "rtde":
        ur_speed = {"robot_ip": given["robot_ip"], **tool, **gel, **lifecycle}
        nodes.append((LifecycleNode, "midastouch_motion", "ur_speed", ur_speed))
    wrench = [("wrench", UR_WRENCH)] if given["arm"] == "ur_driver" else []
    respawn = given["use_respawn"] == "true"

    def ended(event, context):
        # bad input (2) stays bad, and so does an explorer that gave up; after a Shutdown the launch would exit with 0
        stays = event.process_name.startswith("explorer") and event.returncode == 0
        again = respawn and event.returncode != 2 and not event.process_name.startswith("explorer")
        if not (context.is_shutdown or stays or again):
            raise RuntimeError(f"{event.process_name} ended with exit code {event.returncode}: ending all")

    return [
        action(
            package=package,
            executable=name,
            name=name,
            namespace=given["namespace"],
            parameters=[*files, parameters],
            remappings=wrench,
            ros_arguments=["--log-level", given["log_level"]],
            output="screen",
            respawn=respawn and name != "explorer",
            respawn_delay=2.0,
            on_exit=ended,
        )
        for action, package, name, parameters in nodes
    ]
