"""Node `view`: draws a part of the other nodes' messages into the live view's scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image, PointCloud2
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common.errors import InputError
from midastouch_common.frames import TRUTH_FRAME, TRUTH_GEL_FRAME
from midastouch_common.message_arrays import (
    covariance_from_msg,
    points_from_msg,
    pose_from_msg,
    probabilities_from_msg,
    rgb_from_msg,
    stamp_ns,
    transform_from_msg,
)
from midastouch_common.ros import qos
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.node import PipelineNode
from midastouch_common.ros.parameters import Parameter, Parameters
from midastouch_msgs.msg import FilterStatus, PoseModes

PARAMETERS = (
    Parameter(
        "rate", 2.0, "Times per second at which the newest of each topic is drawn", "Hz", minimum=0.1, maximum=60.0
    ),
)

_JUMP_NS = 500_000_000
SILENT_S = 3.0
_WAITING = "waiting", "for the filter; if it runs, see that ROS_DOMAIN_ID and --namespace are its own"
_SILENT = "no filter_status", "no news from the filter; what is drawn may be old"
_ENDED = "ended", "the filter's node has ended; what is drawn is the last of it"


@dataclass(frozen=True)
class _Topic:
    name: str
    kind: type
    profile: QoSProfile
    draw: Callable[[Any], None]
    holding: bytes = b""  # bytes that a message must hold to be drawn; others would displace those that do


class View(PipelineNode):
    """Node that draws the newest message of every topic `rate` times per second; others are not even deserialised."""

    def __init__(self, scene, **kwargs) -> None:
        super().__init__("view", **kwargs)
        settings = Parameters(self, PARAMETERS)
        self._scene = scene
        self._newest: dict[str, bytes] = {}
        self._stamp = 0
        self._quiet_ticks, self._silent_after = 0, max(1, round(SILENT_S * settings["rate"]))
        self._silence: tuple[str, ...] = _WAITING  # what is shown about the silence; empty while the filter is heard
        self._last_word = ""
        scene.status(*_WAITING, {})
        latest, reliable = qos.stream_subscriber(), qos.stream_subscriber(reliable=True)
        self._guide = f"calibrate: {self.resolve_topic_name('calibrate')}"
        topics = (
            # In the order in which they are drawn: the mesh clears everything about the previous object.
            _Topic("object_mesh", MarkerArray, qos.latched(), self._mesh),
            _Topic("filter_status", FilterStatus, qos.latched(), self._status),
            _Topic(
                "object_hypotheses",
                Detection3DArray,
                qos.latched(),
                lambda msg: scene.objects(probabilities_from_msg(msg)),
            ),
            _Topic("image_raw", Image, latest, lambda msg: scene.image(rgb_from_msg(msg, msg.height, msg.width))),
            # Large: Fast DDS loses such messages unless they are sent again on request.
            _Topic("particles/cloud", PointCloud2, reliable, self._particles),
            _Topic("pose_modes", PoseModes, latest, self._modes),
            _Topic("pose", PoseWithCovarianceStamped, qos.latched(), self._pose),
            _Topic("tactile/points", PointCloud2, latest, lambda msg: scene.contact(points_from_msg(msg))),
            # All of TF arrives here, but only the truth, which few recordings have, is drawn.
            _Topic("/tf", TFMessage, qos.TF, self._truth, TRUTH_GEL_FRAME.encode()),
            _Topic("/diagnostics", DiagnosticArray, qos.stream_subscriber(10), self._guidance, self._guide.encode()),
        )
        self._topics = topics
        for topic in topics:
            self.create_subscription(
                topic.kind, topic.name, lambda data, topic=topic: self._keep(topic, data), topic.profile, raw=True
            )
        self.create_timer(1 / settings["rate"], self._draw, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _keep(self, topic: _Topic, data: bytes) -> None:
        if topic.holding in data:
            self._newest[topic.name] = data

    def _draw(self) -> None:
        taken, self._newest = self._newest, {}
        if "filter_status" in taken:
            self._quiet_ticks, self._silence = 0, ()
        else:
            self._quiet_ticks += 1
        for topic in self._topics:
            if topic.name not in taken:
                continue
            try:
                topic.draw(deserialize_message(taken[topic.name], topic.kind))
            except InputError as error:
                self.get_logger().warning(f"{topic.name}: {error}", throttle_duration_sec=5.0)
        if self._quiet_ticks >= self._silent_after and self._silence != _WAITING:
            silence = state, words = _SILENT if self.count_publishers("filter_status") else _ENDED
            if silence != self._silence:
                self._silence = silence
                self._scene.status(state, f"{words}; it last said {self._last_word}", {})

    def _mesh(self, msg: MarkerArray) -> None:
        for marker in msg.markers:
            if marker.type == Marker.MESH_RESOURCE and marker.action == Marker.ADD:
                mesh = load_mesh(marker.mesh_resource, "object_mesh")
                self._scene.mesh(mesh.vertices, mesh.faces, mesh.vertex_normals)

    def _status(self, msg: FilterStatus) -> None:
        stamp = stamp_ns(msg.header.stamp)
        # waiting: earlier frames are still to be answered; stale: the stamp itself may be wrong
        if msg.state not in (FilterStatus.STATE_WAITING, FilterStatus.STATE_STALE):
            if stamp < self._stamp - _JUMP_NS:
                self._scene.restart()
            self._stamp = stamp
        if msg.state == FilterStatus.STATE_UNINITIALISED:
            self._scene.objects({})
        self._last_word = f"{msg.state}: {msg.reason}"
        numbers = {"particles/all": msg.n_particles, "particles/effective": msg.ess, "mass/best": msg.mode_mass}
        numbers |= {f"ms/{name}": ms for name, ms in zip(msg.stage_names, msg.stage_ms, strict=False)}
        self._scene.status(msg.state, msg.reason, {k: v for k, v in numbers.items() if np.isfinite(v)})

    def _guidance(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            if status.name == self._guide:
                self._scene.guidance(status.message, {value.key: value.value for value in status.values})

    def _particles(self, msg: PointCloud2) -> None:
        cloud = points_from_msg(msg, ("x", "y", "z", "normal_x", "normal_y", "normal_z", "intensity"))
        self._scene.particles(cloud[:, :3], cloud[:, 3:6], cloud[:, 6])

    def _pose(self, msg: PoseWithCovarianceStamped) -> None:
        self._scene.estimate(pose_from_msg(msg.pose.pose))

    def _modes(self, msg: PoseModes) -> None:
        poses = np.array([pose_from_msg(mode.pose.pose) for mode in msg.modes]).reshape(-1, 4, 4)
        covariances = np.array([covariance_from_msg(mode.pose.covariance) for mode in msg.modes]).reshape(-1, 6, 6)
        weights = np.clip(np.nan_to_num([mode.weight for mode in msg.modes]), 0.0, 1.0)
        self._scene.modes(weights.tolist(), poses, covariances)

    def _truth(self, msg: TFMessage) -> None:
        for transform in msg.transforms:
            if (transform.header.frame_id, transform.child_frame_id) == (TRUTH_FRAME, TRUTH_GEL_FRAME):
                self._scene.truth(transform_from_msg(transform.transform))
