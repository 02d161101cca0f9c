"""Our interfaces, as generated and built: fields, constants, and the wire type of the stand-in tf2_msgs."""

import json
from pathlib import Path

import pytest
import vision_msgs.msg
from ament_index_python.packages import get_package_share_directory
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from tf2_msgs.msg import TFMessage

from midastouch_msgs import action
from midastouch_msgs.msg import (
    ExplorerStatus,
    FilterStatus,
    PoseMode,
    PoseModes,
    Suggestion,
    TactileCode,
    TactileContact,
)
from midastouch_msgs.srv import CheckReach, SetObject, SuggestMotion

WANTED_MOTION = {"max_length": "double", "lifts": "boolean", "count": "uint32"}

FIELDS = {
    TactileCode: {
        "header": "std_msgs/Header",
        "in_contact": "boolean",
        "contact_area": "float",
        "code": "sequence<float>",
        "network_id": "string",
    },
    TactileContact: {"header": "std_msgs/Header", "in_contact": "boolean", "area": "float", "depth": "float"},
    PoseMode: {"weight": "double", "pose": "geometry_msgs/PoseWithCovariance"},
    PoseModes: {
        "header": "std_msgs/Header",
        "modes": "sequence<midastouch_msgs/PoseMode>",
        "symmetries": "sequence<geometry_msgs/Transform>",
        "symmetry_free": "string",
        "symmetry_axis": "geometry_msgs/Vector3",
        "symmetry_centre": "geometry_msgs/Point",
    },
    FilterStatus: {
        "header": "std_msgs/Header",
        "state": "string",
        "reason": "string",
        "symmetry": "string",
        "n_particles": "uint32",
        "ess": "double",
        "n_modes": "uint32",
        "mode_mass": "double",
        "spread_translation": "double",
        "spread_rotation": "double",
        "likelihood_trend": "double",
        "skipped_names": "sequence<string>",
        "skipped_counts": "sequence<uint64>",
        "stage_names": "sequence<string>",
        "stage_ms": "sequence<double>",
    },
    ExplorerStatus: {
        "header": "std_msgs/Header",
        "state": "string",
        "reason": "string",
        "path_length": "double",
        "slides": "uint32",
        "lifts": "uint32",
    },
    CheckReach.Request: {"poses": "geometry_msgs/PoseArray"},
    CheckReach.Response: {"reachable": "sequence<boolean>", "message": "string"},
    SetObject.Request: {"mesh_path": "string", "codebook_path": "string"},
    SetObject.Response: {"success": "boolean", "message": "string"},
    Suggestion: {
        "heading": "double",
        "length": "double",
        "lift": "boolean",
        "information": "double",
        "cost": "double",
        "reason": "string",
        "path": "sequence<geometry_msgs/Pose>",
    },
    SuggestMotion.Request: WANTED_MOTION,
    SuggestMotion.Response: {
        "success": "boolean",
        "message": "string",
        "indistinguishable": "boolean",
        "suggestions": "sequence<midastouch_msgs/Suggestion>",
    },
    action.SuggestMotion.Goal: WANTED_MOTION,
    action.SuggestMotion.Feedback: {
        "header": "std_msgs/Header",
        "suggestions": "sequence<midastouch_msgs/Suggestion>",
    },
    action.SuggestMotion.Result: {"success": "boolean", "message": "string", "indistinguishable": "boolean"},
}


@pytest.mark.parametrize("message", FIELDS, ids=lambda m: m.__name__)
def test_fields(message):
    assert message.get_fields_and_field_types() == FIELDS[message]


def test_states_are_those_of_the_filter():
    names = [name for name in dir(FilterStatus) if name.startswith("STATE_")]
    values = {getattr(FilterStatus, name) for name in names}
    assert values == {"uninitialised", "no_contact", "ambiguous", "converged", "lost", "stale", "searching", "waiting"}
    assert all(name == "STATE_" + getattr(FilterStatus, name).upper() for name in names)


def test_message_survives_serialisation():
    sent = TactileCode(in_contact=True, contact_area=0.5, code=[0.25, -0.5], network_id="fast@0")
    sent.header.stamp.sec = 7
    assert deserialize_message(serialize_message(sent), TactileCode) == sent


def test_stand_in_vision_msgs_has_the_fields_of_the_real_one():
    """As of vision_msgs 4, in their order: the rest of the wire format follows."""
    pose = "geometry_msgs/PoseWithCovariance"
    fields = {
        "Detection3DArray": {"header": "std_msgs/Header", "detections": "sequence<vision_msgs/Detection3D>"},
        "Detection3D": {
            "header": "std_msgs/Header",
            "results": "sequence<vision_msgs/ObjectHypothesisWithPose>",
            "bbox": "vision_msgs/BoundingBox3D",
            "id": "string",
        },
        "ObjectHypothesisWithPose": {"hypothesis": "vision_msgs/ObjectHypothesis", "pose": pose},
        "ObjectHypothesis": {"class_id": "string", "score": "double"},
        "BoundingBox3D": {"center": "geometry_msgs/Pose", "size": "geometry_msgs/Vector3"},
    }
    for name, expected in fields.items():
        found = getattr(vision_msgs.msg, name).get_fields_and_field_types()
        assert list(found.items()) == list(expected.items())


def test_stand_in_tf2_msgs_is_the_real_type_on_the_wire():
    fields = {"transforms": "sequence<geometry_msgs/TransformStamped>"}
    assert TFMessage.get_fields_and_field_types() == fields
    share = get_package_share_directory("tf2_msgs")
    description = json.loads(Path(share, "msg", "TFMessage.json").read_text())
    hashes = {item["type_name"]: item["hash_string"] for item in description["type_hashes"]}
    real = get_typestore(Stores.ROS2_JAZZY).hash_rihs01("tf2_msgs/msg/TFMessage")
    assert hashes["tf2_msgs/msg/TFMessage"] == real
