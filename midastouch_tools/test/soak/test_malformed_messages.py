"""Messages with bad fields and bytes that are none: nothing dies, nothing published is not finite."""

from __future__ import annotations

import time

import numpy as np
import pytest
from filter_fakes import all_finite, cloud_msg, code_msg, pose_msg
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2
from slide import PATIENT, Slide, filter_parameters, image_at, tdn_parameters, transform_msg
from spoil import spoil
from std_msgs.msg import Header
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesisWithPose

from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_filter.core.state import STATES
from midastouch_filter.nodes.detection_prior import DetectionPrior
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus, PoseModes
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_tools.nodes.replay import Replay


def good_messages(slide: Slide) -> dict:
    """By topic that some node subscribes: a function that makes a usable message of the stamp."""
    penetration = np.zeros((160, 120), np.float32)
    penetration[60:80, 40:60] = 1e-3
    return {
        "image_raw": lambda stamp: image_at(slide, 0, stamp),
        "tactile/points": lambda stamp: cloud_msg(stamp, penetration),
        "tactile/code": lambda stamp: code_msg(stamp, network_id=""),
        "/tf": lambda stamp: transform_msg(slide.poses[0], stamp),
        "/tf_static": lambda stamp: transform_msg(slide.poses[0], stamp, "other_"),
        "detections": lambda _: Detection3DArray(detections=[Detection3D(results=[ObjectHypothesisWithPose()])]),
        "initialpose": lambda _: pose_msg("object", slide.poses[0]),
        "object_pose_prior": lambda _: pose_msg("base_link", slide.poses[0]),
        "filter_status": lambda stamp: FilterStatus(header=Header(stamp=stamp_from_ns(stamp)), state="lost"),
    }


@pytest.mark.dds
def test_malformed_messages_of_every_type(graph, slide, minutes, figures, simulated_sequence):
    """Each subscriber gets as many with bad fields, and some bytes that are no message; then work goes on."""
    number = round(100 * minutes) if minutes else 20
    rng = np.random.default_rng(0)
    live = {"queue_depth": 50, "reliable": True}
    tdn = graph.add(TdnNode, tdn_parameters(slide, **live))
    tcn = graph.add(TcnNode, live)
    running = graph.add(ParticleFilterNode, filter_parameters(slide, **live, **PATIENT, transform_timeout=0.05))
    graph.add(DetectionPrior, {"min_score": 0.0, "period": 0.0})
    replay = graph.add(Replay, {"source": str(simulated_sequence(n=2).path), "ack_topic": "filter_status"})
    kinds = [(PoseModes, "pose_modes", False), (PoseArray, "particles", False), (PointCloud2, "particles/cloud", False)]
    kinds += [(FilterStatus, "filter_status", True), (PoseWithCovarianceStamped, "pose", True)]
    outputs = {topic: graph.listen(kind, topic, latched) for kind, topic, latched in kinds}

    publishers = {}
    for topic, make in good_messages(slide).items():
        latched = topic in ("/tf_static", "filter_status")
        publishers[topic] = graph.publisher(type(make(0)), topic, latched=latched)
        for i in range(number):
            message = make(SECOND + i * SECOND // 60)
            for _ in range(rng.integers(1, 4)):
                message = spoil(message, rng)
            publishers[topic].publish(message)
            graph.spin_for(0.005)
        for size in (0, 3, 4, 40, 4000):
            publishers[topic].publish(b"\x00\x01\x00\x00"[:size] + rng.bytes(max(0, size - 4)))
            graph.spin_for(0.005)
    spoilt = [s for s in outputs["filter_status"] if s.state in STATES and s.state != "lost"]
    assert all(s.reason for s in spoilt)
    # the flood's own statuses are the only ones that may hold what is not finite
    for topic in ("pose_modes", "particles", "particles/cloud", "pose"):
        assert all(map(all_finite, outputs[topic]))

    stamps: list[int] = []
    due = 0.0

    def answered() -> bool:
        nonlocal due
        if time.monotonic() > due:
            due = time.monotonic() + 1.0
            stamps.append(100 * SECOND + len(stamps) * SECOND)
            publishers["/tf"].publish(transform_msg(slide.poses[0], stamps[-1]))
            publishers["image_raw"].publish(image_at(slide, len(stamps) % 20, stamps[-1]))
        return any(stamp_ns(m.header.stamp) in stamps for m in outputs["pose_modes"])

    graph.spin_until(answered, "the answer to a good frame")
    refused = {node.get_name(): node.diagnostics.counts for node in (tdn, tcn, running)}
    figures["malformed"] = {"of_each_topic": number, "topics": list(publishers), "refused": refused}
    assert refused["tdn"]["bad_images"] > 0.3 * number
    assert refused["tcn"]["bad_clouds"] > 0.2 * number
    assert {"bad_transforms", "bad_initialpose", "bad_object_pose_prior"} <= set(refused["particle_filter"])
    assert replay.error is None
