"""A replay through the nodes in processes of their own, with a filter that stalls for longer than any time-out."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from process_rig import SHIPPED, processes
from recorded import write
from replay_rig import answers, frames, replay, stamps
from sensor_msgs.msg import Image
from stalling_filter import STALL_S
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common.message_arrays import stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import image_to_msg, stamp_from_ns
from midastouch_msgs.msg import FilterStatus
from midastouch_msgs.srv import SetObject
from midastouch_tools.bags.messages import sequence_messages

pytestmark = [pytest.mark.dds, pytest.mark.slow]
MS = 1_000_000
QUEUE = {"queue_depth": 100, "reliable": True, "use_sim_time": True}
NODES = SHIPPED | {"particle_filter": [str(Path(__file__).with_name("stalling_filter.py"))]}


def connect(graph, statuses: list, image) -> None:
    """Return when an image gets as far as the filter: all of them have found each other."""
    images = graph.publisher(Image, "image_raw", qos.stream_publisher(100))
    sent = []

    def heard() -> bool:
        sent.append((len(sent) + 1) * MS)
        header = Header(stamp=stamp_from_ns(sent[-1]), frame_id="digit_optical_frame")
        images.publish(image_to_msg(image, "rgb8", header))
        graph.spin_for(0.2)
        return any(stamp_ns(status.header.stamp) in sent for status in statuses)

    graph.spin_until(heard, "an answer of the filter")
    graph.companion.destroy_publisher(images)


def test_every_frame_is_sent_once_in_order_and_answered(graph, tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=20)
    recorded = [
        dataclasses.replace(m, stamp_ns=m.stamp_ns + 30 * MS) if m.topic == "/tf" else m
        for m in sequence_messages(sequence)
    ]
    write(tmp_path / "x.mcap", *sorted(recorded, key=lambda m: m.stamp_ns))
    overrides = {
        "tdn": {"background": str(sequence.background_path)},
        "particle_filter": {"mesh": "/data/mug.ply", "codebook": "/data/mug.npz", "transform_timeout": 1.0},
    }
    with processes(NODES, {name: QUEUE | overrides.get(name, {}) for name in NODES}, tmp_path):
        statuses = graph.listen(FilterStatus, "filter_status", latched=True)
        connect(graph, statuses, sequence.image(0))
        node = replay(graph, tmp_path / "x.mcap", ack_topic="filter_status", ack_timeout=0.05, clock=True)
        assert 2 * node.get_parameter("ack_timeout").value < STALL_S
        images, moving = graph.listen(Image, "image_raw"), graph.listen(TFMessage, "/tf")
        node.start()
        graph.spin_until(lambda: len(images) >= 10, "half of the images")
        request = SetObject.Request(mesh_path="/data/cup.ply", codebook_path="/data/cup.npz")
        assert graph.call(SetObject, "set_object", request).success
        graph.spin_until(node.finished.is_set, "the end")
        wanted = sequence.stamps_ns.tolist()
        # an answer after a frame was given up takes the loss back: once the replay, too, has heard it
        graph.spin_until(
            lambda: all(answers(wanted, statuses)) and node.player.frames_lost == 0,
            "an answer to each, here and in the replay",
        )
        changed = "stale: the object was changed while this code waited for its transform"
        said = [tuple(f"{status.state}: {status.reason}" for status in each) for each in answers(wanted, statuses)]
        assert set(said) <= {("ambiguous: as told",), (changed,)}
        assert said.count((changed,)) <= 1
        assert frames(node) == (20, 0, 0)
        assert stamps(images) == wanted
        of_transforms = [stamp_ns(m.transforms[0].header.stamp) for m in moving]
        assert of_transforms == wanted
        skipped = dict(zip(statuses[-1].skipped_names, statuses[-1].skipped_counts, strict=True))
        assert (skipped["out_of_order"], skipped["time_jumps"]) == (0, 0)
