"""A replay that waits for the filter's answers: what is recorded, once and in order; over real DDS."""

import dataclasses

import pytest
from rclpy.node import Node
from recorded import write
from replay_rig import Consumer, begun, frames, paced
from tf2_msgs.msg import TFMessage

from midastouch_common.ros import qos
from midastouch_msgs.msg import FilterStatus
from midastouch_tools.bags.messages import sequence_messages
from midastouch_tools.replay import player

pytestmark = pytest.mark.dds
MS = 1_000_000


def test_with_one_frame_in_flight_best_effort_loses_none(graph, simulated_sequence):
    sequence = simulated_sequence(n=12)
    consumer, node = begun(graph, sequence.path, answers=lambda n: True)
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns.tolist()
    assert frames(node) == (12, 0, 0)


def test_the_filter_itself_must_listen_to_transforms(graph, simulated_sequence):
    sequence = simulated_sequence(n=2)
    consumer = Consumer(graph, answers=lambda n: True)
    viewer = graph.add(Node, node_name="viewer")
    viewer.create_subscription(TFMessage, "/tf", lambda _: None, qos.TF)
    node = paced(graph, sequence.path)
    node.start()
    graph.spin_for(0.2)
    assert consumer.received == []
    graph.listen(TFMessage, "/tf")
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns.tolist()


def test_the_next_image_waits_for_the_answer_and_is_sent_once(graph, simulated_sequence):
    """Far beyond any patience, as the filter is silent: it may load an object."""
    first, second, third = simulated_sequence(n=3).stamps_ns.tolist()
    consumer = Consumer(graph, answers=lambda n: n == 3)
    node = paced(graph, simulated_sequence(n=3).path, ack_timeout=0.05)
    moving = graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: consumer.received, "the first image")
    consumer.answer(5 * MS)
    consumer.report("lifecycle")  # the filter loads
    graph.spin_for(0.2)
    assert consumer.received == [first]
    consumer.answer(first)
    graph.spin_until(lambda: consumer.received == [first, second], "the second image")
    consumer.answer(second, FilterStatus.STATE_WAITING)
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == [first, second, third]
    graph.spin_until(lambda: len(moving) == 3, "the transforms")
    assert frames(node) == (3, 0, 0)


def test_what_the_filter_says_nothing_of_is_given_up_and_counted(graph, simulated_sequence):
    sequence = simulated_sequence(n=4)
    consumer, node = begun(graph, sequence.path, answers=lambda n: n == 4, ack_timeout=3.0)
    graph.spin_until(lambda: len(consumer.received) == 2, "the second image")
    consumer.answer(consumer.received[0])  # late
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns.tolist()
    assert frames(node) == (4, 0, 2)


def test_after_a_loss_it_waits_until_all_listeners_are_back(graph, simulated_sequence):
    """A depth network that dies and is started again costs the image it had."""
    sequence = simulated_sequence(n=4)
    consumer, node = begun(graph, sequence.path, answers=lambda n: n != 2, ack_timeout=3.0)
    graph.spin_until(lambda: len(consumer.received) == 2, "the second image")
    graph.companion.destroy_subscription(consumer.images)
    graph.spin_until(lambda: node.player.frames_lost == 1, "the loss")
    graph.spin_for(0.2)
    assert not node.finished.is_set()
    consumer.listen()
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns.tolist()
    assert (node.player.frames_sent, node.player.frames_lost) == (4, 1)


def test_transforms_do_not_overrun_a_busy_filter(graph, tmp_path, simulated_sequence, monkeypatch):
    """Nobody is told how many messages a subscriber has lost: no more go out than it keeps."""
    monkeypatch.setattr(player, "MOST_AFTER_AN_IMAGE", 5)
    static, *messages = sequence_messages(simulated_sequence(n=20))
    images = [m for m in messages if m.topic == "/image_raw"]
    chosen = [static, images[0], *(m for m in messages if m.topic == "/tf"), images[-1]]
    write(tmp_path / "x.mcap", *(dataclasses.replace(m, stamp_ns=images[-1].stamp_ns) for m in chosen))
    consumer = Consumer(graph, answers=lambda n: n > 1)
    node = paced(graph, tmp_path / "x.mcap")
    moving = graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: consumer.received and len(moving) == 5, "the image and some transforms")
    graph.spin_for(0.2)
    assert len(moving) == 5
    consumer.answer(consumer.received[0])
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(moving) == 20, "all transforms")


def test_what_still_waits_after_the_end_is_no_loss(graph, simulated_sequence):
    """Without /clock nobody can let the filter's time run out."""
    consumer, node = begun(graph, simulated_sequence(n=2).path, answers=lambda n: False, ack_timeout=3.0)
    for n in (1, 2):
        graph.spin_until(lambda n=n: len(consumer.received) == n, "an image")
        consumer.answer(consumer.received[-1], FilterStatus.STATE_WAITING)
    graph.spin_until(node.finished.is_set, "the end")
    assert (node.player.frames_sent, node.player.frames_lost) == (2, 0)
    assert node.player.summary().partition("; ")[2].startswith("2 still wait")
