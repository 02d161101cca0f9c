"""Bags of runs: the messages of a sequence, and results of the nodes made up."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from recorded import write

from midastouch_common import se3
from midastouch_tools.bags.messages import Message, header, sequence_messages
from midastouch_tools.bags.messages import new_message as new
from midastouch_tools.datasets import Sequence

STATUS = "midastouch_msgs/msg/FilterStatus"


def pose(transform: np.ndarray):
    x, y, z, *turn = se3.to_xyzquat(transform).tolist()
    turned = new("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn, strict=True)))
    return new("geometry_msgs/msg/Pose", position=new("geometry_msgs/msg/Point", x=x, y=y, z=z), orientation=turned)


def transform(matrix: np.ndarray):
    x, y, z = matrix[:3, 3].tolist()
    moved = new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
    return new("geometry_msgs/msg/Transform", translation=moved, rotation=pose(matrix).orientation)


def of_frame(stamp: int, truth: np.ndarray, in_contact: bool, turns: int, turned: np.ndarray) -> list[Message]:
    """Results of a filter that has the gel at `turned` (4, 4) times the truth, on an object that so many turns about z
    map onto itself."""
    found, about = turned @ truth, {"header": header(stamp, "object")}
    uncertain = new("geometry_msgs/msg/PoseWithCovariance", pose=pose(found), covariance=np.arange(36.0))
    mode = new("midastouch_msgs/msg/PoseMode", weight=0.75, pose=uncertain)
    symmetries = [transform(se3.exp([0, 0, 0, 0, 0, 2 * np.pi * k / turns])) for k in range(turns)]
    counts, times = {"n_particles": 700, "n_modes": 1}, {"stage_names": ["motion", "weights"]}
    times["stage_ms"] = np.array([1.5, 2.0])
    code = np.array([0.6, 0.8] if in_contact else [], np.float32)
    penetration = {"height": 3, "width": 2, "encoding": "32FC1", "step": 8}
    penetration["data"] = np.arange(6, dtype=np.float32).view(np.uint8)
    contents = {
        "/filter_status": new(STATUS, **about, state="converged", mode_mass=0.75, **counts, **times),
        "/pose_modes": new(
            "midastouch_msgs/msg/PoseModes", **about, modes=[mode], symmetries=symmetries, symmetry_free="none"
        ),
        "/particles": new("geometry_msgs/msg/PoseArray", **about, poses=[pose(found), pose(np.eye(4))]),
        "/pose": new("geometry_msgs/msg/PoseWithCovarianceStamped", **about, pose=uncertain),
        "/tactile/code": new(
            "midastouch_msgs/msg/TactileCode", **about, in_contact=in_contact, code=code, network_id="net"
        ),
        "/tactile/penetration": new("sensor_msgs/msg/Image", **about, **penetration),
    }
    return [Message.of(topic, content, stamp) for topic, content in contents.items()]


def hypotheses(stamp: int, probabilities: Mapping[str, float]) -> Message:
    """What `particle_filter` says of which object it is, without poses."""
    detections = []
    for name, score in probabilities.items():
        hypothesis = new("vision_msgs/msg/ObjectHypothesis", class_id=name, score=score)
        result = new("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=hypothesis)
        detections.append(new("vision_msgs/msg/Detection3D", results=[result]))
    array = new("vision_msgs/msg/Detection3DArray", header=header(stamp, "object"), detections=detections)
    return Message.of("/object_hypotheses", array, stamp)


def other(stamp: int, state: str) -> Message:
    """A status beside the answer of a frame."""
    content = new(STATUS, header=header(stamp, "object"), state=state, n_particles=5)
    return Message.of("/filter_status", content, stamp)


def diagnostics(stamp: int, node: str, rate: float, ms: float) -> Message:
    values = [new("diagnostic_msgs/msg/KeyValue", key=k, value=str(v)) for k, v in (("rate_hz", rate), ("mean_ms", ms))]
    status = new("diagnostic_msgs/msg/DiagnosticStatus", name=f"{node}: /{node}", values=values)
    array = new("diagnostic_msgs/msg/DiagnosticArray", header=header(stamp, "object"), status=[status])
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
    turned = np.eye(4) if turned is None else turned
    messages = list(sequence_messages(sequence))
    images = [m for m in messages if m.topic == "/image_raw"]
    for i in repeated:
        messages.append(images[i])
    for i, probabilities in (objects or {}).items():
        messages.append(hypotheses(int(sequence.stamps_ns[i]), probabilities))
    for i in waited:
        messages.append(other(int(sequence.stamps_ns[i]), "waiting"))
    for i in answered:
        stamp, truth = int(sequence.stamps_ns[i]), sequence.poses_true[i]
        messages += of_frame(stamp, truth, i != 1, turns, turned)
    for i in refused:
        messages.append(other(int(sequence.stamps_ns[i]), "stale"))
    last = int(sequence.stamps_ns[-1])
    messages += [diagnostics(last, "tdn", 10.0, 3.0), diagnostics(last, "tdn", 30.0, 5.0)]
    messages += [diagnostics(last, "tcn", 0.0, 0.0)]
    kept = (message for message in messages if message.topic not in without)
    return write(path, *kept, metadata={"object": sequence.object_name})
