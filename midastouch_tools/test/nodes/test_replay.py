"""The replay over real DDS: every frame, in order, with its transforms; its clock, and its ends."""

import dataclasses
import re

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.time import Time
from recorded import write
from replay_rig import play, replay, stamps
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage
from tf2_ros import Buffer

from midastouch_common.errors import InputError
from midastouch_common.frames import BASE_FROM_OBJECT
from midastouch_common.message_arrays import image_from_msg, stamp_ns, transform_from_msg
from midastouch_tools.bags.messages import sequence_messages
from midastouch_tools.bags.writer import write_bag

pytestmark = pytest.mark.dds


@pytest.mark.parametrize("form", ["sequence", "bag"])
def test_every_frame_arrives_in_order_with_its_transforms(graph, tmp_path, simulated_sequence, form):
    sequence = simulated_sequence(n=6)
    source = sequence.path
    if form == "bag":
        source = tmp_path / "slide.mcap"
        write_bag(sequence, source)
    node = replay(graph, source)
    images, infos = graph.listen(Image, "image_raw"), graph.listen(CameraInfo, "camera_info")
    moving, static = graph.listen(TFMessage, "/tf"), graph.listen(TFMessage, "/tf_static", latched=True)
    play(graph, node)
    graph.spin_until(lambda: len(images) == len(infos) == len(moving) == 6 and static, "all messages")

    assert stamps(images) == stamps(infos) == sequence.stamps_ns.tolist()
    buffer = Buffer()
    for message in moving:
        for t in message.transforms:
            buffer.set_transform(t, "replay")

    def known(target, source, stamp):
        return transform_from_msg(buffer.lookup_transform(target, source, Time.from_msg(stamp)).transform)

    for i, image in enumerate(images):
        np.testing.assert_array_equal(image_from_msg(image), sequence.image(i))
        assert image.header.frame_id == "digit_optical_frame"
        stamp = image.header.stamp
        measured = known("base_link", "digit_gel_frame", stamp)
        np.testing.assert_allclose(measured, BASE_FROM_OBJECT @ sequence.poses_measured[i], atol=1e-9)
        truth = known("object_ground_truth", "digit_gel_ground_truth", stamp)
        np.testing.assert_allclose(truth, sequence.poses_true[i], atol=1e-9)
    assert (node.player.frames_sent, node.player.frames_lost, node.error) == (6, 0, None)


def test_waits_for_its_listeners(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=2).path, wait_for_subscribers=2)
    first = graph.listen(Image, "image_raw")
    node.start()
    graph.spin_for(0.2)
    assert not first
    second = graph.listen(Image, "image_raw")
    graph.spin_until(lambda: len(first) == len(second) == 2, "both frames at both listeners")


def test_clock_follows_the_recording_and_jumps_back_once_a_loop(graph, simulated_sequence):
    sequence = simulated_sequence(n=3)
    node = replay(graph, sequence.path, loop=True, clock=True, rate=1.0)
    images, clock = graph.listen(Image, "image_raw"), graph.listen(Clock, "/clock")
    node.start()

    def jumps():
        return np.count_nonzero(np.diff([stamp_ns(message.clock) for message in clock]) < 0)

    graph.spin_until(lambda: len(images) >= 7 and jumps() >= 2, "the third round")
    assert stamps(images)[:7] == sequence.stamps_ns.tolist() * 2 + sequence.stamps_ns[:1].tolist()
    told = [stamp_ns(message.clock) for message in clock]
    assert set(sequence.stamps_ns.tolist()) <= set(told)
    assert max(told) == sequence.stamps_ns[-1]
    assert jumps() <= 1 + len(images) // 3
    assert len(set(told)) > 3  # it also runs between the three frames
    assert not node.finished.is_set()


@pytest.mark.usefixtures("brisk_health")
def test_a_gap_in_the_recording_is_said_and_can_be_skipped(graph, tmp_path, simulated_sequence):
    """As of a computer whose clock was set while it recorded."""
    first, *others = (m for m in sequence_messages(simulated_sequence(n=3)) if m.topic == "/image_raw")
    years = 10**18
    write(tmp_path / "x.mcap", first, *(dataclasses.replace(m, stamp_ns=m.stamp_ns + years) for m in others))
    node = replay(graph, tmp_path / "x.mcap", rate=1.0)
    reports = graph.listen(DiagnosticArray, "/diagnostics")
    node.start()
    gap = r"nothing is recorded for .* s: set seek_to"
    graph.spin_until(lambda: any(re.match(gap, s.message) for r in reports for s in r.status), "the warning")
    assert graph.set_parameter("replay", "seek_to", 1e9).successful
    graph.spin_until(node.finished.is_set, "the end")
    assert node.player.frames_sent == 3


def test_a_damaged_image_ends_the_replay_with_its_name(graph, simulated_sequence):
    sequence = simulated_sequence(n=4)
    sequence.image_paths[2].write_bytes(b"")
    node = replay(graph, sequence.path)
    images = graph.listen(Image, "image_raw")
    play(graph, node)
    assert isinstance(node.error, InputError)
    assert "2.jpg" in str(node.error)
    graph.spin_until(lambda: len(images) == 2, "the frames before it")


@pytest.mark.parametrize(
    ("source", "message"), [("", "'source' is empty"), ("/nowhere/slide", "no such file or folder")]
)
def test_bad_sources_are_refused_at_the_start(graph, source, message):
    with pytest.raises(InputError, match=message):
        replay(graph, source)


def test_destroying_ends_a_replay_that_waits(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=2).path, wait_for_subscribers=9)
    node.start()
    graph.remove_all()
    assert node.finished.is_set()
