"""A replay that waits for the filter's answers: one frame in flight, sent again or given up; over real DDS."""

import pytest
from filter_fakes import code_msg, loader_of
from replay_rig import Consumer, play, replay
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_bringup.bags import BagWriter
from midastouch_bringup.messages import sequence_messages
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import stamp_from_ns, stamp_ns

pytestmark = pytest.mark.dds
MS = 1_000_000


def test_one_frame_in_flight_loses_none_with_a_best_effort_listener(graph, simulated_sequence):
    sequence = simulated_sequence(n=12)
    consumer = Consumer(graph, answers=lambda n: True)
    node = replay(graph, sequence.path, ack_topic="filter_status", wait_for_subscribers=1)
    graph.listen(TFMessage, "/tf")
    play(graph, node)
    assert consumer.received == sequence.stamps_ns.tolist()
    assert (node.frames_sent, node.frames_repeated, node.frames_lost) == (12, 0, 0)


def test_the_next_frame_waits_for_the_answer(graph, simulated_sequence):
    sequence = simulated_sequence(n=3)
    consumer = Consumer(graph, answers=lambda n: False)
    node = replay(graph, sequence.path, ack_topic="filter_status", ack_timeout=30.0)
    graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: consumer.received, "the first image")
    graph.spin_for(0.3)
    assert set(consumer.received) == {sequence.stamps_ns[0]}
    foreign = FilterStatus(header=Header(stamp=stamp_from_ns(5 * MS)))
    consumer.statuses.publish(foreign)
    graph.spin_for(0.2)
    assert set(consumer.received) == {sequence.stamps_ns[0]}
    answer = FilterStatus(header=Header(stamp=stamp_from_ns(int(sequence.stamps_ns[0]))))
    consumer.statuses.publish(answer)
    graph.spin_until(lambda: sequence.stamps_ns[1] in consumer.received, "the second image")


def test_the_first_frame_is_repeated_soon_while_nodes_find_each_other(graph, simulated_sequence):
    consumer = Consumer(graph, answers=lambda n: n > 1)
    node = replay(
        graph, simulated_sequence(n=1).path, ack_topic="filter_status", wait_for_subscribers=1, ack_timeout=600.0
    )
    graph.listen(TFMessage, "/tf")
    play(graph, node)
    assert len(consumer.received) == 2
    assert node.frames_lost == 0


def test_a_frame_without_answer_is_sent_again_with_its_transform(graph, simulated_sequence):
    sequence = simulated_sequence(n=3)
    consumer = Consumer(graph, answers=lambda n: n != 2)  # the second image is lost on the way
    node = replay(graph, sequence.path, ack_topic="filter_status", wait_for_subscribers=1, ack_timeout=0.5, clock=True)
    moving, clock = graph.listen(TFMessage, "/tf"), graph.listen(Clock, "/clock")
    play(graph, node)
    first, second, third = sequence.stamps_ns.tolist()
    assert consumer.received == [first, second, second, third]
    assert (node.frames_sent, node.frames_repeated, node.frames_lost) == (3, 1, 0)
    graph.spin_until(lambda: len(moving) == 4, "the repeated transform")
    told = [stamp_ns(message.clock) for message in clock]
    assert told == sorted(told)  # repeating does not turn back the clock


def test_a_frame_never_answered_is_given_up_and_counted(graph, simulated_sequence):
    consumer = Consumer(graph, answers=lambda n: False)
    node = replay(graph, simulated_sequence(n=2).path, ack_topic="filter_status", ack_timeout=0.05, ack_attempts=3)
    graph.listen(TFMessage, "/tf")
    play(graph, node)
    assert (node.frames_sent, node.frames_repeated, node.frames_lost) == (2, 4, 2)
    graph.spin_until(lambda: len(consumer.received) >= 2, "the images")


def test_images_without_transforms_do_not_each_wait_for_the_time_out(graph, tmp_path, simulated_sequence):
    """A bag whose arm came 2.5 s after the camera, had a gap of 2 s, and left 0.4 s earlier, at 10 Hz."""
    sequence = simulated_sequence(n=68)
    present = {*sequence.stamps_ns[25:40].tolist(), *sequence.stamps_ns[60:65].tolist()}
    with BagWriter(tmp_path / "x.mcap") as bag:
        for message in sequence_messages(sequence):
            if message.topic != "/tf" or message.stamp_ns in present:
                bag.write(message)
    filters = []
    parameters = {"mesh": "/data/a.ply", "codebook": "/data/a.npz", "queue_depth": 100, "reliable": True}
    parameters["transform_timeout"] = 600.0
    graph.add(lambda **options: ParticleFilterNode(load=loader_of(filters), **options), parameters)
    codes = graph.companion.create_publisher(TactileCode, "tactile/code", qos.stream_publisher(100))

    def feel(image):
        codes.publish(code_msg(stamp_ns(image.header.stamp)))

    graph.companion.create_subscription(Image, "image_raw", feel, qos.stream_subscriber(100, reliable=True))
    node = replay(graph, tmp_path / "x.mcap", ack_topic="filter_status", wait_for_subscribers=1, ack_timeout=600.0)
    play(graph, node)
    assert (node.frames_sent, node.frames_lost) == (68, 0)
    # what lies within the gap is interpolated over it; only before and after there is nothing
    assert len(filters[0].measurements) == 40
