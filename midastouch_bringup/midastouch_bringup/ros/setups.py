"""Set-ups of `midastouch run`: each starts the processes of the launch file of its name, without ROS 2's launch.

The launch files declare the arguments in this table. A test runs every launch file and compares its processes and their
parameters with the table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from midastouch_perception.objects import bundled_objects

from .launch_arguments import ARGUMENTS, OF_NODES, OF_OBJECT, SHARE


@dataclass(frozen=True)
class Executable:
    """A process with nodes of ours. `when`: (argument, value) that it needs to be started, None if it always is.

    `ends`: True if it ends by itself once its work is done; starting it again would do the work twice.
    """

    package: str
    name: str
    when: tuple[str, str] | None = None
    ends: bool = False


@dataclass(frozen=True)
class Setup:
    """Processes that are started together. A part that is a name stands for all parts of that set-up.

    `defaults`: of arguments that have another default here; `choices`: of those that take fewer values here.
    """

    summary: str
    arguments: tuple[str, ...]
    parts: tuple[Executable | str, ...]
    defaults: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def values(self) -> dict[str, str]:
        """Return every argument with its default."""
        return {name: self.defaults.get(name, ARGUMENTS[name].default) for name in self.arguments}

    def allowed(self, name: str) -> tuple[str, ...]:
        """Return the values that an argument may take; empty if it may take any."""
        return self.choices.get(name, ARGUMENTS[name].choices)


_PERCEPTION = ("serial", "background", "sensor_model")
_RVIZ = ("use_rviz", "rviz_config")
_LIVE = (
    *(*OF_NODES, "composed", *_PERCEPTION, *OF_OBJECT),
    *("arm", "robot_ip", "ur_type", "kinematics_params_file", "use_mock_hardware", "tf_prefix"),
    *("frames_file", "tool_frame", "sensor_prefix", *_RVIZ),
)
_REAL_ARMS = {"arm": ("running", "ur_driver", "rtde")}
_RECORDING = (
    *("bag", "rate", "loop", *OF_NODES, "setup_file", "composed", *_PERCEPTION, *OF_OBJECT),
    *("tf_prefix", "sensor_prefix", *_RVIZ),
)
# a recording has its own time, and no frame of it may be lost
_OF_RECORDINGS = {"use_sim_time": "true", "setup_file": str(SHARE / "config" / "replay.yaml")}

SETUPS = {
    "driver": Setup(
        "the DIGIT's driver",
        (*OF_NODES, "serial", "sensor_prefix"),
        (Executable("digit_driver", "digit_driver"),),
    ),
    "digit_sim": Setup(
        "a simulated DIGIT, moved by TF, in place of the driver",
        (*OF_NODES, "object", "mesh", "sensor_model", "sensor_prefix"),
        (Executable("midastouch_simulation", "digit_sim"),),
    ),
    "perception": Setup(
        "from tactile images to codes",
        (*OF_NODES, *_PERCEPTION, "sensor_prefix"),
        (Executable("midastouch_perception", "tdn"), Executable("midastouch_perception", "tcn")),
    ),
    "filter": Setup(
        "from codes and transforms to the pose of the sensor on the object",
        (*OF_NODES, *OF_OBJECT, "sensor_model", "tf_prefix", "sensor_prefix"),
        (Executable("midastouch_filter", "particle_filter"),),
    ),
    "localization": Setup(
        "perception and filter: in processes of their own, or in one",
        (*OF_NODES, "composed", *_PERCEPTION, *OF_OBJECT, "tf_prefix", "sensor_prefix"),
        (
            Executable("midastouch_bringup", "all_in_one", when=("composed", "true")),
            Executable("midastouch_perception", "tdn", when=("composed", "false")),
            Executable("midastouch_perception", "tcn", when=("composed", "false")),
            Executable("midastouch_filter", "particle_filter", when=("composed", "false")),
        ),
    ),
    # the launch file uses robot_state_publisher instead, which also gives RViz the sensor's shape
    "mount": Setup(
        "static TF from the arm's tool to the DIGIT's frames",
        ("namespace", "use_respawn", "log_level", "frames_file", "tool_frame", "tf_prefix", "sensor_prefix"),
        (Executable("midastouch_motion", "mount_tf"),),
    ),
    "live_ur": Setup(
        "a DIGIT on a UR arm: driver, mount, localisation",
        _LIVE,
        (Executable("midastouch_motion", "ur_tf", when=("arm", "rtde")), "mount", "driver", "localization"),
        {"sensor_model": "digit_real"},
        _REAL_ARMS,
    ),
    "explore_ur": Setup(
        "a DIGIT on a UR arm that touches an object by itself until the filter knows where it is",
        (*_LIVE, "setup_file", "record"),
        (
            "live_ur",
            Executable("midastouch_motion", "ur_speed", when=("arm", "rtde")),
            Executable("midastouch_motion", "contact_controller"),
            Executable("midastouch_tools", "recorder"),
            Executable("midastouch_motion", "explorer", ends=True),
        ),
        {"sensor_model": "digit_real", "setup_file": str(SHARE / "config" / "explore_ur.yaml")},
        _REAL_ARMS,
    ),
    "replay": Setup(
        "a recording through perception and filter, in its own time, without losing a frame",
        _RECORDING,
        ("localization", Executable("midastouch_tools", "replay", ends=True)),
        _OF_RECORDINGS,
    ),
    "explore": Setup(
        "a simulated finger or arm that explores an object by itself until the filter knows where it is",
        ("arm", *(name for name in _RECORDING if name not in ("bag", "rate", "loop", "sensor_model"))),
        (
            "digit_sim",
            "localization",
            Executable("midastouch_simulation", "simulated_finger", when=("arm", "finger")),
            Executable("midastouch_simulation", "mujoco_arm", when=("arm", "mujoco")),
            Executable("midastouch_motion", "contact_controller", when=("arm", "mujoco")),
            Executable("midastouch_motion", "explorer", ends=True),
        ),
        # with this seed it knows the pose soon; with others it may give up
        {
            "arm": "finger",
            "object": "star_knob",
            "objects": ",".join(bundled_objects()),
            "seed": "2",
            "setup_file": str(SHARE / "config" / "explore.yaml"),
            "rviz_config": str(SHARE / "rviz" / "explore.rviz"),
        },
        {"arm": ("finger", "mujoco")},
    ),
    "demo": Setup(
        "a simulated slide over a bundled object, made on the first run, played like a recording",
        tuple(name for name in _RECORDING if name not in ("bag", "sensor_model")),
        ("replay",),
        {**_OF_RECORDINGS, "object": "handle_tool", "loop": "true"},
    ),
}


def executables(setup: str, given: Mapping[str, str]) -> Iterator[Executable]:
    """Yield the executables that a set-up starts with `given`, the values of its arguments."""
    for part in SETUPS[setup].parts:
        if isinstance(part, str):
            yield from executables(part, given)
        elif part.when is None or given[part.when[0]] == part.when[1]:
            yield part
