"""Bags of runs: the messages of a sequence, and results of the nodes made up."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from recorded import write

from midastouch_common import se3
from midastouch_tools.bags.messages import Message, sequence_messages, typestore
from midastouch_tools.bags.messages import header as header_of
from midastouch_tools.datasets import Sequence


class Results:
    """Serialised results of the nodes, made up."""

    def new(self, type_name: str, **fields):
        return typestore().types[type_name](**fields)

    def pose(self, transform: np.ndarray):
        x, y, z, qx, qy, qz, qw = se3.to_xyzquat(transform).tolist()
        point = self.new("geometry_msgs/msg/Point", x=x, y=y, z=z)
        return self.new(
            "geometry_msgs/msg/Pose",
            position=point,
            orientation=self.new("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )

    def symmetry(self, turns: int) -> dict:
        """The fields of `PoseModes` on an object that so many turns about z map onto itself."""
        nothing = {"x": 0.0, "y": 0.0, "z": 0.0}
        angles = [[0, 0, 0, 0, 0, 2 * np.pi * k / turns] for k in range(turns)]
        return {
            "symmetries": [self.transform(se3.exp(each)) for each in angles],
            "symmetry_free": "none",
            "symmetry_axis": self.new("geometry_msgs/msg/Vector3", **nothing),
            "symmetry_centre": self.new("geometry_msgs/msg/Point", **nothing),
        }

    def transform(self, transform: np.ndarray):
        pose = self.pose(transform)
        place = self.new("geometry_msgs/msg/Vector3", x=pose.position.x, y=pose.position.y, z=pose.position.z)
        return self.new("geometry_msgs/msg/Transform", translation=place, rotation=pose.orientation)

    def of_frame(
        self, stamp: int, truth: np.ndarray, in_contact: bool, turns: int, turned: np.ndarray
    ) -> list[Message]:
        """As of a filter that has the gel at `turned` (4, 4) times the truth."""
        found = turned @ truth
        header = header_of(stamp, "object")
        covariance = np.arange(36.0)
        with_covariance = self.new("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(found), covariance=covariance)
        mode = self.new("midastouch_msgs/msg/PoseMode", weight=0.75, pose=with_covariance)
        contents = {
            "/filter_status": self.new(
                "midastouch_msgs/msg/FilterStatus",
                header=header,
                state="converged",
                reason="",
                symmetry="",
                n_particles=700,
                ess=600.0,
                n_modes=1,
                mode_mass=0.75,
                spread_translation=0.001,
                spread_rotation=0.01,
                likelihood_trend=1.0,
                skipped_names=[],
                skipped_counts=np.zeros(0, np.uint64),
                stage_names=["motion", "weights"],
                stage_ms=np.array([1.5, 2.0]),
            ),
            "/pose_modes": self.new(
                "midastouch_msgs/msg/PoseModes", header=header, modes=[mode], **self.symmetry(turns)
            ),
            "/particles": self.new(
                "geometry_msgs/msg/PoseArray", header=header, poses=[self.pose(found), self.pose(np.eye(4))]
            ),
            "/pose": self.new("geometry_msgs/msg/PoseWithCovarianceStamped", header=header, pose=with_covariance),
            "/tactile/code": self.new(
                "midastouch_msgs/msg/TactileCode",
                header=header,
                in_contact=in_contact,
                contact_area=1e-4,
                code=np.array([0.6, 0.8], np.float32) if in_contact else np.zeros(0, np.float32),
                network_id="net",
            ),
            "/tactile/penetration": self.new(
                "sensor_msgs/msg/Image",
                header=header,
                height=3,
                width=2,
                encoding="32FC1",
                is_bigendian=0,
                step=8,
                data=np.arange(6, dtype=np.float32).view(np.uint8),
            ),
        }
        return [Message.of(topic, content, stamp) for topic, content in contents.items()]

    def objects(self, stamp: int, probabilities: Mapping[str, float]) -> Message:
        """What `particle_filter` says of which object it is, without poses."""
        header = header_of(stamp, "object")
        at = self.new("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(np.eye(4)), covariance=np.zeros(36))
        box = self.new(
            "vision_msgs/msg/BoundingBox3D",
            center=at.pose,
            size=self.new("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0),
        )
        detections = []
        for name, score in probabilities.items():
            hypothesis = self.new("vision_msgs/msg/ObjectHypothesis", class_id=name, score=score)
            result = self.new("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=at)
            one = self.new("vision_msgs/msg/Detection3D", header=header, results=[result], bbox=box, id="")
            detections.append(one)
        array = self.new("vision_msgs/msg/Detection3DArray", header=header, detections=detections)
        return Message.of("/object_hypotheses", array, stamp)

    def other(self, stamp: int, state: str) -> Message:
        """A status beside the answer of a frame."""
        kind = "midastouch_msgs/msg/FilterStatus"
        empty = {
            "skipped_names": [],
            "skipped_counts": np.zeros(0, np.uint64),
            "stage_names": [],
            "stage_ms": np.zeros(0),
        }
        numbers = dict.fromkeys(("ess", "mode_mass", "spread_translation", "spread_rotation", "likelihood_trend"), 0.0)
        content = self.new(
            kind,
            header=header_of(stamp, "object"),
            state=state,
            reason="",
            symmetry="",
            n_particles=5,
            n_modes=0,
            **numbers,
            **empty,
        )
        return Message.of("/filter_status", content, stamp)

    def diagnostics(self, stamp: int, node: str, rate: float, ms: float) -> Message:
        values = [
            self.new("diagnostic_msgs/msg/KeyValue", key=k, value=str(v))
            for k, v in (("rate_hz", rate), ("mean_ms", ms))
        ]
        status = self.new(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=0,
            name=f"{node}: /{node}",
            message="",
            hardware_id="",
            values=values,
        )
        array = self.new("diagnostic_msgs/msg/DiagnosticArray", header=header_of(stamp, "object"), status=[status])
        return Message.of("/diagnostics", array, stamp)


def write_run(
    sequence: Sequence,
    path: Path,
    answered: Collection[int],
    repeated: Collection[int] = (),
    waited: Collection[int] = (),
    refused: Collection[int] = (),
    without: Collection[str] = (),
    objects: Mapping[int, Mapping[str, float]] | None = None,
    turns: int = 1,
    turned: np.ndarray | None = None,
) -> Path:
    """Write a bag of a sequence: results of `answered` frames only, nothing on topics `without`.

    objects: probabilities that come with a frame. turns: so many about z map the object onto itself. turned (4, 4): the
    motion of the object's frame from the true pose of the gel to the one that is found, by default none.
    """
    results, turned = Results(), np.eye(4) if turned is None else turned
    messages = list(sequence_messages(sequence))
    images = [m for m in messages if m.topic == "/image_raw"]
    for i in repeated:
        messages.append(images[i])
    for i, probabilities in (objects or {}).items():
        messages.append(results.objects(int(sequence.stamps_ns[i]), probabilities))
    for i in waited:
        messages.append(results.other(int(sequence.stamps_ns[i]), "waiting"))
    for i in answered:
        stamp, truth = int(sequence.stamps_ns[i]), sequence.poses_true[i]
        messages += results.of_frame(stamp, truth, i != 1, turns, turned)
    for i in refused:
        messages.append(results.other(int(sequence.stamps_ns[i]), "stale"))
    last = int(sequence.stamps_ns[-1])
    messages += [results.diagnostics(last, "tdn", 10.0, 3.0), results.diagnostics(last, "tdn", 30.0, 5.0)]
    messages += [results.diagnostics(last, "tcn", 0.0, 0.0)]
    kept = (message for message in messages if message.topic not in without)
    return write(path, *kept, metadata={"object": sequence.object_name})
