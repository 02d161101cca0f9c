"""A gripper with a DIGIT on each of two fingers, simulated or yours (hand:=running): where is the object in it?"""

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction, Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import LifecycleNode, Node

SHARE = get_package_share_directory("midastouch_bringup")
WORDS = ["true", "false"], ["simulated", "running"]
ARGUMENTS = {
    "hand": ("simulated", "What holds the object: a simulated gripper, or yours, whose TF has both gel frames"),
    "params_file": (f"{SHARE}/config/midastouch.yaml", "Parameters of all nodes"),
    "setup_file": ("", "What this launch file itself changes in params_file; empty: with a simulated hand its pace"),
    "params_overlay": ("", "Parameter file of yours, over both; it may hold only what differs"),
    "log_level": ("info", "What the nodes log: debug, info, warn, error or fatal"),
    "object": ("star_knob", "Bundled object that is held"),
    "mesh": ("", "Mesh of the object in its place, metres: a path or package://..."),
    "codebook": ("", "Codebook of that mesh; empty: a coarse one is built"),
    "sensor_model": ("", "Kind of both sensors: digit_real with a hand of yours, else digit_tacto; or a YAML file"),
    "base_frame": ("base_link", "Frame in which the object rests while nothing holds it"),
    "gripper_frame": ("gripper", "Frame in which the object rests while the gripper holds it, e.g. tool0"),
    "left_serial": ("", "Serial number of the left DIGIT"),
    "right_serial": ("", "Serial number of the right DIGIT"),
    "pinches": ("6", "A simulated gripper ends once the filter is sure in one, or after so many"),
    "seed": ("0", "Seed of the filter and of the simulation"),
    "use_rviz": ("true", "Start RViz"),
}


def generate_launch_description():
    """Start driver or `digit_sim` and perception for both sensors, one filter, and a simulated gripper."""
    declared = [
        DeclareLaunchArgument(name, default_value=v, description=text, choices=next((c for c in WORDS if v in c), None))
        for name, (v, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])


def included(name, **arguments):
    """Another of our launch files, with these arguments and those of this one."""
    source = PythonLaunchDescriptionSource(f"{SHARE}/launch/{name}.launch.py")
    return IncludeLaunchDescription(source, launch_arguments=arguments.items())


def start(context):
    """Start everything. The filter runs in the namespace `left`, and its poses are those of the left gel."""
    given = context.launch_configurations
    simulated = given["hand"] == "simulated"
    if not simulated and not (given["left_serial"] and given["right_serial"]):
        raise RuntimeError("hand:=running: which sensor is where? Give left_serial:=SERIAL and right_serial:=SERIAL")
    if simulated and not given["setup_file"]:
        given["setup_file"] = f"{SHARE}/config/explore_finger.yaml"
    bundled = f"package://midastouch_perception/midastouch_perception/objects/{given['object']}.ply"
    given["mesh"] = given["mesh"] or bundled
    given["sensor_model"] = given["sensor_model"] or ("digit_tacto" if simulated else "digit_real")
    files = [given[name] for name in ("params_file", "setup_file", "params_overlay") if given[name]]
    common = {"sensor_model": given["sensor_model"], "mesh": given["mesh"], "seed": int(given["seed"])}
    common |= {f"{name}_frame_id": given[f"{name}_frame"] for name in ("base", "gripper")}
    fingers = {"sensor_frame_id": "left_digit_gel_frame", "fingers": "/right:right_digit_gel_frame"}

    def ended(event, context):
        if context.is_shutdown:
            return None
        if event.returncode == 0 and "simulated_gripper" in event.process_name:
            return Shutdown(reason="the gripper has ended")
        if event.returncode == 1 and "simulated_gripper" in event.process_name:
            raise RuntimeError("after its last pinch the filter is not sure of the right pose: ending all")
        raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")

    words = {"ros_arguments": ["--log-level", given["log_level"]], "output": "screen", "on_exit": ended}
    actions = []
    for number, side in enumerate(("left", "right")):
        here = {"namespace": side, "sensor_prefix": f"{side}_", "serial": given[f"{side}_serial"], "object": ""}
        own = {"seed": str(int(given["seed"]) + number)} if simulated else {}
        actions += [included(name, **here, **own) for name in ("digit_sim" if simulated else "driver", "perception")]
    actions.append(
        LifecycleNode(
            package="midastouch_filter",
            executable="particle_filter",
            name="particle_filter",
            namespace="left",
            parameters=[*files, common | fingers | {"codebook": given["codebook"]}],
            **words,
        )
    )
    if simulated:
        parameters = [*files, common | {"pinches": int(given["pinches"])}]
        package, executable = "midastouch_simulation", "simulated_gripper"
        actions.append(Node(package=package, executable=executable, parameters=parameters, **words))
    if given["use_rviz"] == "true":
        actions.append(included("rviz", namespace="left"))
    return actions
