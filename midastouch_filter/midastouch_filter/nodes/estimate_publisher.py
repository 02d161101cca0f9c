"""Publisher of the filter node's results: estimate, modes, particles, status, the object's frame and its identity.

This module alone guards against non-finite numbers: it publishes no message that holds one.
"""

from __future__ import annotations

import array
import dataclasses
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point, PoseArray, PoseWithCovariance, PoseWithCovarianceStamped, Vector3
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesis, ObjectHypothesisWithPose
from visualization_msgs.msg import MarkerArray

from midastouch_common import se3
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import pose_to_msg, stamp_from_ns, stamped_transform, transform_to_msg
from midastouch_common.ros.parameters import Parameters
from midastouch_msgs.msg import FilterStatus, PoseMode, PoseModes
from midastouch_perception.symmetry.group import Symmetry

from ..core.alignment import transform_covariance
from ..core.estimate import Estimate
from ..core.state import CONVERGED, LOST, Status
from ..identification.identity import UNKNOWN, Identity
from ..loaded_object import RunningFilter
from . import markers


class Placed(NamedTuple):
    """Gel in the frame in which the object's pose is published, the base or the gripper.

    pose: (4, 4), of the gel; held: whether the object is in the gripper.
    """

    pose: np.ndarray
    held: bool


class EstimatePublisher:
    """Publisher of one filter node's results.

    Messages for viewers (particles, cloud, hypotheses) are built only while they have subscribers, at most
    `view_rate` times per second of `clock` [s].
    """

    def __init__(self, node: Node, parameters: Parameters, clock: Callable[[], float]):
        self._parameters, self._clock = parameters, clock
        self._last_view = -math.inf
        self.skipped = {"no_subscriber": 0, "view_rate": 0}
        depth = parameters["queue_depth"]
        latched, stream = qos.latched(depth), qos.stream_publisher(depth)
        self._status = node.create_publisher(FilterStatus, "filter_status", latched)
        self._pose = node.create_publisher(PoseWithCovarianceStamped, "pose", latched)
        self._sent_symmetry: Symmetry | None = None
        self._sent_fields: dict = {}
        self._modes = node.create_publisher(PoseModes, "pose_modes", stream)
        self._particles = node.create_publisher(PoseArray, "particles", stream)
        self._cloud = node.create_publisher(PointCloud2, "particles/cloud", stream)
        self._hypotheses = node.create_publisher(MarkerArray, "hypotheses", stream)
        self._object_pose = node.create_publisher(PoseWithCovarianceStamped, "object_pose", latched)
        self._object_modes = node.create_publisher(PoseModes, "object_pose_modes", stream)
        self._parent = parameters["gripper_frame_id"] or parameters["base_frame_id"]
        self._objects = node.create_publisher(Detection3DArray, "object_hypotheses", latched)
        self._mesh = node.create_publisher(MarkerArray, "object_mesh", qos.latched())
        self._tf = node.create_publisher(TFMessage, "/tf", qos.TF)

    def show_object(self, mesh: str | Path) -> None:
        """Show another mesh (a path or a package:// address) and remove the drawings on the last one."""
        header = Header(frame_id=self._parameters["object_frame_id"])
        address = str(mesh) if "://" in str(mesh) else Path(mesh).resolve().as_uri()
        self._hypotheses.publish(markers.cleared_hypotheses(header))
        self._mesh.publish(markers.object_mesh(address, header))

    def status(self, stamp: int, status: Status) -> None:
        """Publish a status on its own, without a processed frame."""
        self._status.publish(_status_to_msg(status, self._header(stamp)))

    def estimate(self, stamp: int, estimate: Estimate, running: RunningFilter, placed: Placed) -> None:
        """Publish the answer to the frame of `stamp` [ns]."""
        header = self._header(stamp)
        if not _finite(estimate):
            # The status still goes out: every frame gets an answer.
            reason = "the filter's result is not finite and was withheld; call reinitialize_global_localization"
            self.status(stamp, dataclasses.replace(estimate.status, state=LOST, reason=reason))
            return
        symmetry = self._symmetry_fields(running)
        _publish_poses(self._pose, self._modes, header, estimate, symmetry, _pose_to_msg)
        if placed.held and estimate.modes:
            in_gripper = Header(stamp=header.stamp, frame_id=self._parent)
            of_object = partial(_object_pose, T_base_gel=placed.pose)
            _publish_poses(self._object_pose, self._object_modes, in_gripper, estimate, symmetry, of_object)
        if estimate.status.state == CONVERGED and self._parameters["tf_broadcast"]:
            self._broadcast(stamp, placed.pose @ se3.inverse(estimate.pose))
        self._view(header, estimate, running)
        # Last, so that everything else of this frame is out when a listener sees its status.
        self.status(stamp, estimate.status)

    def identity(self, identity: Identity, T_base_gel: np.ndarray, stamp: int) -> None:
        """Publish which objects may be touched at `stamp` [ns], and each one's pose with the gel at T_base_gel."""
        header = Header(stamp=stamp_from_ns(stamp), frame_id=self._parameters["base_frame_id"])
        self._objects.publish(object_hypotheses(identity, T_base_gel, header))

    def _header(self, stamp: int) -> Header:
        return Header(stamp=stamp_from_ns(stamp), frame_id=self._parameters["object_frame_id"])

    def _symmetry_fields(self, running: RunningFilter) -> dict:
        """Return the fields of `PoseModes` on symmetry; they are made again only for another object."""
        symmetry = running.object.symmetry.exact
        if symmetry is not self._sent_symmetry:
            self._sent_symmetry, self._sent_fields = symmetry, _symmetry_to_fields(symmetry)
        return self._sent_fields

    def _broadcast(self, stamp: int, T_parent_obj: np.ndarray) -> None:
        ahead = stamp_from_ns(stamp + round(1e9 * self._parameters["transform_tolerance"]))
        moved = stamped_transform(ahead, self._parent, self._parameters["object_frame_id"], T_parent_obj)
        self._tf.publish(TFMessage(transforms=[moved]))

    def _view(self, header: Header, estimate: Estimate, running: RunningFilter) -> None:
        viewed = [p for p in (self._particles, self._cloud, self._hypotheses) if p.get_subscription_count() > 0]
        if not viewed:
            self.skipped["no_subscriber"] += 1
            return
        rate, now = self._parameters["view_rate"], self._clock()
        period = 1.0 / rate if rate > 0 else 0.0
        # A clock that ran back (a looped bag) does not silence the views until it has caught up.
        if 0 <= now - self._last_view < period:
            self.skipped["view_rate"] += 1
            return
        self._last_view = now
        if self._hypotheses in viewed:
            lifetime = max(3 * period, 1.0)
            self._hypotheses.publish(markers.hypotheses(estimate.modes, header, lifetime))
        if self._particles in viewed or self._cloud in viewed:
            poses, weights = running.poses, running.weights
            if not (np.isfinite(poses).all() and np.isfinite(weights).all()):
                return
            if self._particles in viewed:
                self._particles.publish(markers.particle_poses(poses, weights, header))
            if self._cloud in viewed:
                self._cloud.publish(markers.particle_cloud(poses, weights, header))


def _publish_poses(
    pose: Publisher,
    modes: Publisher,
    header: Header,
    estimate: Estimate,
    symmetry: dict,
    message: Callable[[np.ndarray, np.ndarray], PoseWithCovariance],
) -> None:
    """Publish the estimate's pose, if there is one, and its modes; message(pose, covariance): of each."""
    if estimate.modes:
        best = message(estimate.pose, estimate.covariance)
        pose.publish(PoseWithCovarianceStamped(header=header, pose=best))
    each = [PoseMode(weight=float(m.weight), pose=message(m.pose, m.covariance)) for m in estimate.modes]
    modes.publish(PoseModes(header=header, modes=each, **symmetry))


def _symmetry_to_fields(symmetry: Symmetry) -> dict:
    centred = symmetry.free != PoseModes.SYMMETRY_FREE_NONE
    axis = symmetry.axis if symmetry.free == PoseModes.SYMMETRY_FREE_AXIS else np.zeros(3)
    return {
        "symmetries": [transform_to_msg(motion) for motion in symmetry.transforms],
        "symmetry_free": symmetry.free,
        "symmetry_axis": Vector3(**dict(zip("xyz", axis.tolist(), strict=True))),
        "symmetry_centre": Point(**dict(zip("xyz", (symmetry.centre * centred).tolist(), strict=True))),
    }


def _finite(estimate: Estimate) -> bool:
    whole = estimate.covariance is None or np.isfinite(estimate.covariance).all()
    return bool(whole) and all(
        math.isfinite(m.weight) and np.isfinite(m.pose).all() and np.isfinite(m.covariance).all()
        for m in estimate.modes
    )


def _pose_to_msg(pose: np.ndarray, covariance: np.ndarray) -> PoseWithCovariance:
    return PoseWithCovariance(pose=pose_to_msg(pose), covariance=covariance.ravel().tolist())


def _status_to_msg(status: Status, header: Header) -> FilterStatus:
    number = {
        name: value if math.isfinite(value := float(getattr(status, field))) else 0.0
        for name, field in (
            ("ess", "ess"),
            ("mode_mass", "mode_mass"),
            ("spread_translation", "spread_t"),
            ("spread_rotation", "spread_r"),
            ("likelihood_trend", "likelihood_trend"),
            ("unknown", "unknown"),
        )
    }
    return FilterStatus(
        header=header,
        state=status.state,
        reason=status.reason,
        symmetry=status.symmetry,
        n_particles=status.n_particles,
        n_modes=status.n_modes,
        skipped_names=list(status.skipped),
        skipped_counts=array.array("Q", status.skipped.values()),
        stage_names=list(status.ms),
        stage_ms=array.array("d", status.ms.values()),
        **number,
    )


def object_hypotheses(identity: Identity, T_base_gel: np.ndarray, header: Header) -> Detection3DArray:
    """Return a detection for each object with a hypothesis, most probable first, and one without pose for `unknown`.

    Scores are probabilities, of sum 1 except for objects without a hypothesis. The pose is the object's in the base
    frame, with the gel at T_base_gel (4, 4) and at the object's best hypothesis.
    """
    found = [
        ObjectHypothesisWithPose(
            hypothesis=ObjectHypothesis(class_id=each.name, score=each.probability),
            pose=_object_pose(each.hypotheses[0].pose, each.hypotheses[0].covariance, T_base_gel),
        )
        for each in identity.objects
        if each.hypotheses
    ]
    found.append(ObjectHypothesisWithPose(hypothesis=ObjectHypothesis(class_id=UNKNOWN, score=identity.unknown)))
    return Detection3DArray(
        header=header, detections=[Detection3D(header=header, results=[each], id="") for each in found]
    )


def _object_pose(pose: np.ndarray, covariance: np.ndarray, T_base_gel: np.ndarray) -> PoseWithCovariance:
    """Return the object's pose in the frame in which the gel is at T_base_gel, of a pose T_obj_gel (4, 4) and its
    covariance (6, 6); the result's is about that frame's axes (REP 103)."""
    T_gel_obj = se3.inverse(pose)
    T_base_obj = T_base_gel @ T_gel_obj
    turn = se3.turn(T_base_obj[:3, :3])
    return _pose_to_msg(T_base_obj, turn @ transform_covariance(covariance, T_gel_obj) @ turn.T)
