"""Which objects may be touched, as detections: what a camera would say that sees them."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseWithCovariance
from std_msgs.msg import Header
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesis, ObjectHypothesisWithPose

from midastouch_common import se3
from midastouch_common.ros.conversions import pose_to_msg

from ..core.joint_alignment import transform_covariance
from ..identification.identity import UNKNOWN, Hypothesis, Identity


def object_hypotheses(identity: Identity, T_base_gel: np.ndarray, header: Header) -> Detection3DArray:
    """One detection for each object with a place, most probable first, and one for `unknown`, which has no pose.

    Scores are probabilities of sum 1; the pose is the object's in the base frame, with the gel at T_base_gel (4, 4) and
    at the object's best place.
    """
    found = [
        ObjectHypothesisWithPose(
            hypothesis=ObjectHypothesis(class_id=each.name, score=each.probability),
            pose=_object_pose(each, T_base_gel),
        )
        for each in identity.hypotheses
        if each.places
    ]
    found.append(ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id=UNKNOWN, score=identity.unknown)))
    return Detection3DArray(
        header=header, detections=[Detection3D(header=header, results=[each], id="") for each in found]
    )


def _object_pose(hypothesis: Hypothesis, T_base_gel: np.ndarray) -> PoseWithCovariance:
    """Of the object in the base frame; covariance about the base's axes (REP 103)."""
    place = hypothesis.places[0]
    T_gel_obj = se3.inverse(place.pose)
    T_base_obj = T_base_gel @ T_gel_obj
    turn = se3.turn(T_base_obj[:3, :3])
    covariance = turn @ transform_covariance(place.covariance, T_gel_obj) @ turn.T
    return PoseWithCovariance(pose=pose_to_msg(T_base_obj), covariance=covariance.ravel().tolist())
