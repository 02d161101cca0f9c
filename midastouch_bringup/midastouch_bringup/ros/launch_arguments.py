"""The arguments of the launch files and of `midastouch run`, and the node parameters that they set.

An argument means the same wherever it is taken. If it stands for a parameter, it changes the parameter only if it is
given; empty keeps the value of the parameter file. `setups` lists the `ARGUMENTS` that each launch file takes.

`ros2 launch` imports this module into the Python of ROS, which may lack the libraries of the nodes' Python: this module
and its imports keep to the standard library and to the dependencies of launch.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

from midastouch_filter.core.presets import PRESETS, PRESETS_IN_WORDS

SHARE = Path(get_package_share_directory("midastouch_bringup"))
_YES_NO = ("true", "false")
# all that ur_control.launch.py of the UR driver takes
_UR_TYPES = (
    *("ur3", "ur5", "ur10"),
    *("ur3e", "ur5e", "ur7e", "ur10e", "ur12e", "ur16e"),
    *("ur8long", "ur15", "ur18", "ur20", "ur30"),
)
SIMULATED_ARMS = ("simulated_finger", "mujoco_arm")
STREAM_NODES = ("digit_sim", "tdn", "tcn", "particle_filter")


@dataclass(frozen=True)
class Argument:
    """An argument. `sets` names the parameters (node, parameter) it stands for, `kind` their type.

    `launch_only`: True if it is about something that only `ros2 launch` starts.
    """

    description: str
    default: str = ""
    choices: tuple[str, ...] = ()
    sets: tuple[tuple[str, str], ...] = ()
    kind: type = str
    launch_only: bool = False


ARGUMENTS = {
    # of every launch file
    "namespace": Argument("Namespace of all nodes; one per sensor, e.g. digit_left"),
    "params_file": Argument("Parameters of all nodes", str(SHARE / "config" / "midastouch.yaml")),
    "setup_file": Argument("What this launch file itself changes in params_file"),
    "params_overlay": Argument("Parameter file of yours, over all others; it may hold only what differs"),
    "use_sim_time": Argument("Take the time from /clock", "false", _YES_NO),
    "use_respawn": Argument("Start a node again after it died", "false", _YES_NO),
    "log_level": Argument("What the nodes log", "info", ("debug", "info", "warn", "error", "fatal")),
    "autostart": Argument(
        "Configure and activate the lifecycle nodes without a manager; empty: as in params_file",
        choices=("", "true", "false"),
        sets=tuple((node, "autostart") for node in ("digit_driver", *STREAM_NODES, "contact_controller", "ur_speed")),
        kind=bool,
    ),
    # sensor
    "serial": Argument(
        "Serial number of the DIGIT; empty: the only one, whose captured background is not kept",
        sets=(("digit_driver", "serial"), ("tdn", "serial")),
    ),
    "sensor_model": Argument(
        "Kind of the sensor: digit_real, digit_tacto (simulated), gelsight_mini, or a YAML file; empty: as in the "
        "parameter files",
        sets=tuple((node, "sensor_model") for node in (*STREAM_NODES, *SIMULATED_ARMS, "contact_controller")),
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
    "mesh": Argument(
        "Mesh of the object, metres: a path or package://...",
        sets=tuple((node, "mesh") for node in ("particle_filter", "digit_sim", *SIMULATED_ARMS, "explorer")),
    ),
    "codebook": Argument(
        "Codebook of that mesh; empty: a coarse one is built", sets=(("particle_filter", "codebook"),)
    ),
    "objects": Argument(
        "In place of object, where nobody knows which one it is: names of bundled objects, codebooks, folders of "
        "codebooks and meshes, separated by ','; an exploration adds the object that is touched",
    ),
    "init_mode": Argument(
        "Start: over the whole surface, at initial_pose, or once a pose is given",
        choices=("", "uniform", "pose", "wait"),
        sets=(("particle_filter", "init_mode"),),
    ),
    "preset": Argument(
        f"Filter settings between run time and error ({PRESETS_IN_WORDS}); those in a parameter file go over them",
        choices=("", *PRESETS),
        sets=(("particle_filter", "preset"),),
    ),
    "fingers": Argument(
        "Further sensors on the same object, NAMESPACE:GEL_FRAME separated by ',', e.g. /right:right_digit_gel_frame",
        sets=(("particle_filter", "fingers"),),
    ),
    "seed": Argument(
        "Seed of the filter; in an exploration also of its motions at random, and of a simulated sensor and finger",
        sets=(("particle_filter", "seed"), ("digit_sim", "seed"), ("simulated_finger", "seed"), ("explorer", "seed")),
        kind=int,
    ),
    # arm
    "arm": Argument(
        "Where TF of the arm comes from: an arm that runs already, the UR ROS driver started here, or ur_tf over RTDE, "
        "in explore_ur with ur_speed; in explore: a finger without mechanics, or a UR in MuJoCo",
        "running",
        ("running", "ur_driver", "rtde", "finger", "mujoco"),
    ),
    "robot_ip": Argument(
        "Address of the arm; must be given with arm:=ur_driver and arm:=rtde",
        sets=(("ur_tf", "robot_ip"), ("ur_speed", "robot_ip")),
    ),
    "ur_type": Argument(
        "Model of the arm, for arm:=ur_driver",
        "ur5e",
        _UR_TYPES,
        launch_only=True,
    ),
    "kinematics_params_file": Argument(
        "Calibration of this very arm (ur_calibration), for arm:=ur_driver; without it the tool may be centimetres off",
        launch_only=True,
    ),
    "use_mock_hardware": Argument("Mock arm, for arm:=ur_driver", "false", _YES_NO, launch_only=True),
    "tf_prefix": Argument(
        "Put before the arm's frames and joints, as in the UR driver",
        sets=(("ur_tf", "tf_prefix"), ("mount_tf", "tf_prefix")),
    ),
    # mount
    "frames_file": Argument(
        "Hand-eye calibration and mount",
        str(SHARE / "config" / "frames.yaml"),
        sets=(("mount_tf", "frames_file"),),
    ),
    "sensor_prefix": Argument(
        "Put before the sensor's frames; for several sensors, e.g. left_", sets=(("mount_tf", "sensor_prefix"),)
    ),
    "tool_frame": Argument(
        "Frame the sensor is mounted on, tool0 or tool0_controller; empty: as in frames_file",
        sets=(("mount_tf", "tool_frame"),),
    ),
    # recording
    "bag": Argument("YCB-Slide sequence folder, or bag (.mcap file or rosbag2 folder)", sets=(("replay", "source"),)),
    "rate": Argument(
        "Recorded seconds per second; 0: as fast as the filter follows",
        sets=(("replay", "rate"),),
        kind=float,
    ),
    "record": Argument(
        "Bag that the run is recorded into, with date and time by %Y, %m, %d, %H, %M and %S",
        "out/explore_ur/%Y-%m-%d_%H-%M-%S.mcap",
        sets=(("recorder", "path"),),
    ),
    "loop": Argument("Play again and again", "false", _YES_NO, (("replay", "loop"),), bool),
    # view
    "use_rviz": Argument("Start RViz", "true", _YES_NO, launch_only=True),
    "rviz_config": Argument("RViz configuration", str(SHARE / "rviz" / "midastouch.rviz"), launch_only=True),
}

OF_NODES = ("namespace", "params_file", "params_overlay", "use_sim_time", "use_respawn", "log_level", "autostart")
"""Names of the arguments that every launch file with nodes takes."""
OF_OBJECT = ("object", "mesh", "codebook", "objects", "init_mode", "preset", "fingers", "seed")
"""Names of the filter's arguments, except its frames."""
OF_FILES = ("mesh", "codebook", "background", "bag")
"""Names of the arguments that stand for a file or folder which only the nodes read."""
