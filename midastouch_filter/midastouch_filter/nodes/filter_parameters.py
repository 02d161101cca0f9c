"""Parameters of the `particle_filter` node: its own, and those settings of the filter that a user can judge."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from midastouch_common import se3
from midastouch_common.ros.managed_node import AUTOSTART
from midastouch_common.ros.parameters import QUEUE, Parameter, Parameters

from ..core import config
from ..core.config import FilterConfig
from ..core.presets import BALANCED, PRESETS, PRESETS_IN_WORDS
from ..localiser import Start

_NODE = (
    Parameter("mesh", "", "Mesh of the object, metres: a path or package://NAME/...; empty: wait for set_object"),
    Parameter("codebook", "", "Codebook of that mesh, from `midastouch build-codebook`; empty: one is built and grows"),
    Parameter(
        "objects",
        "",
        "In place of mesh and codebook, where the object is not known: codebooks, folders of codebooks and "
        "meshes, separated by ','; a mesh gets a coarse codebook",
    ),
    Parameter("tcn", "fast", "Code network for a codebook that is built here: the same as of node tcn"),
    Parameter("sensor_model", "digit_tacto", "Geometry of the sensor, as of the node tdn: codebooks must be of it"),
    Parameter(
        "object_folders",
        "",
        "Folders that set_object may load from, separated by ':'; package:// is always allowed; empty: any folder",
    ),
    Parameter(
        "init_mode",
        "uniform",
        "Start: over the whole surface, at initial_pose, or not before a pose is given on initialpose",
        choices=("uniform", "pose", "wait"),
    ),
    Parameter(
        "initial_pose",
        [0.0] * 6,
        "Start of the gel frame in the object's frame, with init_mode pose: x y z [m], roll pitch yaw [rad] about the "
        "object's fixed axes, in this order",
    ),
    Parameter(
        "initial_sigma",
        [0.02, 0.35],
        "Spread of the start per axis, with init_mode pose: in translation [m], in rotation [rad]",
        minimum=0.0,
        maximum=3.15,
    ),
    Parameter("seed", 0, "Seed of the filter's random numbers", minimum=0, maximum=2**31 - 1),
    Parameter("base_frame_id", "base_link", "Frame the object rests in: the arm's base"),
    Parameter("object_frame_id", "object", "Frame of the object, the mesh's own"),
    Parameter("sensor_frame_id", "digit_gel_frame", "Gel frame, moved by the arm"),
    Parameter(
        "fingers",
        "",
        "Further sensors on the same object, NAMESPACE:GEL_FRAME separated by ',': codes and clouds come from the "
        "topics in the namespace (relative to this node's, or absolute), their poses from TF",
    ),
    Parameter(
        "gripper_frame_id",
        "",
        "Frame of a gripper with sensor and fingers: while two of them touch, the object goes with it, and its pose is "
        "published in this frame; empty: the object rests",
    ),
    Parameter("tf_broadcast", True, "Broadcast base or gripper -> object while converged", read_only=False),
    Parameter(
        "transform_tolerance",
        0.1,
        "The broadcast transform is dated this far ahead, so that it can be looked up at the present time",
        unit="s",
        minimum=0.0,
        maximum=10.0,
        read_only=False,
    ),
    Parameter(
        "transform_timeout",
        1.0,
        "A code is given up, state stale, after waiting this long for its transform",
        unit="s",
        minimum=0.0,
        maximum=600.0,
        read_only=False,
    ),
    Parameter(
        "input_timeout",
        2.0,
        "The state is stale after this time without a code",
        unit="s",
        minimum=0.05,
        maximum=3600.0,
        read_only=False,
    ),
    Parameter(
        "view_rate",
        10.0,
        "Highest rate of particles, cloud and hypotheses; 0: with every code",
        unit="Hz",
        minimum=0.0,
        maximum=1000.0,
        read_only=False,
    ),
    Parameter(
        "suggestion_rate",
        2.0,
        "Highest rate of answers of the action suggest_motion; 0: with every code",
        unit="Hz",
        minimum=0.0,
        maximum=1000.0,
        read_only=False,
    ),
    *QUEUE,
    AUTOSTART,
    Parameter(
        "preset",
        BALANCED,
        f"Other defaults of the filter's settings, between run time and error ({PRESETS_IN_WORDS})",
        choices=tuple(PRESETS),
        at_start=True,
        presets=PRESETS,
    ),
)


_SETTINGS = (
    "max_particles",
    "alignments_per_second",
    "refined_modes",
    "refinement",
    "unknown_prior",
    "drift_translation",
    "drift_rotation",
    "jitter_translation",
    "jitter_rotation",
    "finger_translation",
    "finger_rotation",
    "converged_probability",
    "converged_error",
    "converged_rotation",
    "threads",
)
"""Fields of `FilterConfig` that are parameters, too."""


def _of_field(field: dataclasses.Field) -> Parameter:
    data = field.metadata
    return Parameter(
        field.name,
        field.default,
        data["doc"],
        data["unit"],
        minimum=data.get("low"),
        maximum=data.get("high"),
        former=data["former"],
    )


_FIELDS = {field.name: field for field in dataclasses.fields(FilterConfig)}
_CONFIG = tuple(_of_field(_FIELDS[name]) for name in _SETTINGS)

PARAMETERS = _NODE + _CONFIG
GONE = {
    **{name: "it is a setting of FilterConfig, in Python, only" for name in _FIELDS if name not in _SETTINGS},
    **{
        field.metadata["former"]: f"it is {name}, a setting of FilterConfig, in Python, only"
        for name, field in _FIELDS.items()
        if field.metadata["former"] and name not in _SETTINGS
    },
    **config.GONE,
    "finger_tolerance": "codes of two fingers belong together if their stamps are within 50 ms",
    "suggestion_length": "the request of suggest_motion has max_length",
    "suggestion_count": "the request of suggest_motion has count",
    **{
        f"initial_pose.{name}": "initial_pose is one list now: x y z [m], roll pitch yaw [rad]"
        for name in ("x", "y", "z", "roll", "pitch", "yaw")
    },
    "initial_pose.sigma_translation": "it is the first number of initial_sigma",
    "initial_pose.sigma_rotation": "it is the second number of initial_sigma",
}
"""Former parameters, and what replaces each of them."""


def config_of(parameters: Parameters) -> FilterConfig:
    """Return the filter's settings."""
    return FilterConfig(**{parameter.name: parameters[parameter.name] for parameter in _CONFIG})


def start_of(parameters: Parameters) -> Start | None:
    """Return the start that `init_mode`, `initial_pose` and `initial_sigma` describe; None if no pose is given."""
    if parameters["init_mode"] != "pose":
        return None
    position, angles = np.split(np.array(parameters["initial_pose"]), 2)
    rotation = Rotation.from_euler("xyz", angles).as_matrix()
    return Start(se3.make(rotation, position), *parameters["initial_sigma"])
