"""Our interfaces, as generated and built: fields, constants, and the wire type of the stand-in tf2_msgs."""

import json
from pathlib import Path

import vision_msgs.msg
from ament_index_python.packages import get_package_share_directory
from rosbags.typesys import Stores, get_typestore
from tf2_msgs.msg import TFMessage

from midastouch_msgs.msg import FilterStatus


def test_states_are_those_of_the_filter():
    names = [name for name in dir(FilterStatus) if name.startswith("STATE_")]
    values = {getattr(FilterStatus, name) for name in names}
    assert values == {"uninitialised", "no_contact", "ambiguous", "converged", "lost", "stale", "searching", "waiting"}
    assert all(name == "STATE_" + getattr(FilterStatus, name).upper() for name in names)


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
