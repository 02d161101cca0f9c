"""A replay that waits for the filter's answers: what is recorded, once and in order; over real DDS."""

import dataclasses

import pytest
from filter_fakes import code_msg, loader_of
from rclpy.node import Node
from replay_rig import Consumer, play, replay
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from midastouch_bringup.bags.messages import sequence_messages, typestore
from midastouch_bringup.bags.writer import BagWriter
from midastouch_bringup.replay import player
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_perception.message_arrays import stamp_ns
from midastouch_perception.ros import qos

pytestmark = pytest.mark.dds
MS = 1_000_000
PACED = {"ack_topic": "filter_status", "wait_for_subscribers": 1}


def test_one_frame_in_flight_loses_none_with_a_best_effort_listener(graph, simulated_sequence):
    sequence = simulated_sequence(n=12)
    consumer = Consumer(graph, answers=lambda n: True)
    node = replay(graph, sequence.path, **PACED)
    graph.listen(TFMessage, "/tf")
    play(graph, node)
    assert consumer.received == sequence.stamps_ns.tolist()
    assert (node.player.frames_sent, node.player.frames_repeated, node.player.frames_lost) == (12, 0, 0)


def test_the_filter_itself_must_listen_to_transforms(graph, simulated_sequence):
    sequence = simulated_sequence(n=2)
    consumer = Consumer(graph, answers=lambda n: True)
    viewer = graph.add(Node, node_name="viewer")
    viewer.create_subscription(TFMessage, "/tf", lambda _: None, qos.TF)
    node = replay(graph, sequence.path, **PACED)
    node.start()
    graph.spin_for(0.5)
    assert consumer.received == []
    graph.listen(TFMessage, "/tf")
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns.tolist()


def test_the_next_image_waits_for_the_answer_and_is_sent_once(graph, simulated_sequence):
    """Far beyond any patience, as the filter is silent: it may load an object."""
    first, second, third = simulated_sequence(n=3).stamps_ns.tolist()
    consumer = Consumer(graph, answers=lambda n: n == 3)
    node = replay(graph, simulated_sequence(n=3).path, **PACED, ack_timeout=0.05)
    moving = graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: consumer.received, "the first image")
    consumer.answer(5 * MS)
    consumer.report("lifecycle")  # the filter loads
    graph.spin_for(0.5)
    assert consumer.received == [first]
    consumer.answer(first)
    graph.spin_until(lambda: consumer.received == [first, second], "the second image")
    consumer.answer(second, FilterStatus.STATE_WAITING)
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == [first, second, third]
    graph.spin_until(lambda: len(moving) == 3, "the transforms")
    assert (node.player.frames_sent, node.player.frames_repeated, node.player.frames_lost) == (3, 0, 0)


def test_what_the_filter_says_nothing_of_is_given_up_and_counted(graph, simulated_sequence):
    sequence = simulated_sequence(n=4)
    consumer = Consumer(graph, answers=lambda n: n == 4)
    consumer.report_regularly()
    node = replay(graph, sequence.path, **PACED, ack_timeout=3.0)
    graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: len(consumer.received) == 2, "the second image")
    consumer.answer(consumer.received[0])  # late
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns.tolist()
    assert (node.player.frames_sent, node.player.frames_repeated, node.player.frames_lost) == (4, 0, 2)


def test_after_a_loss_it_waits_until_all_listeners_are_back(graph, simulated_sequence):
    """A depth network that dies and is started again costs the image it had."""
    sequence = simulated_sequence(n=4)
    consumer = Consumer(graph, answers=lambda n: n != 2)
    consumer.report_regularly()
    node = replay(graph, sequence.path, **PACED, ack_timeout=3.0)
    graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: len(consumer.received) == 2, "the second image")
    graph.companion.destroy_subscription(consumer.images)
    graph.spin_until(lambda: node.player.frames_lost == 1, "the loss")
    graph.spin_for(0.3)
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
    with BagWriter(tmp_path / "x.mcap") as bag:
        for message in [static, images[0], *(m for m in messages if m.topic == "/tf"), images[-1]]:
            bag.write(dataclasses.replace(message, stamp_ns=images[-1].stamp_ns))
    consumer = Consumer(graph, answers=lambda n: n > 1)
    node = replay(graph, tmp_path / "x.mcap", **PACED)
    moving = graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: consumer.received and len(moving) == 5, "the image and some transforms")
    graph.spin_for(0.3)
    assert len(moving) == 5
    consumer.answer(consumer.received[0])
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(moving) == 20, "all transforms")


class Chain:
    """A filter node with a fake filter, and codes made of the replay's images as soon as they come."""

    def __init__(self, graph, **parameters):
        self.filters, self.sent, self._graph = [], [], graph
        given = {"mesh": "/data/a.ply", "codebook": "/data/a.npz", "queue_depth": 100, "reliable": True, **parameters}
        self.node = graph.add(lambda **options: ParticleFilterNode(load=loader_of(self.filters), **options), given)
        self.statuses = graph.listen(FilterStatus, "filter_status", latched=True)
        codes = graph.companion.create_publisher(TactileCode, "tactile/code", qos.stage_publisher(100))
        graph.spin_until(lambda: codes.get_subscription_count() > 0, "the filter")

        def feel(image):
            self.sent.append(stamp_ns(image.header.stamp))
            codes.publish(code_msg(self.sent[-1]))

        graph.companion.create_subscription(Image, "image_raw", feel, qos.stream_subscriber(100, reliable=True))

    def states(self) -> dict[int, list[str]]:
        """What was said of each image that was sent, by stamp [ns]."""
        said = {stamp: [] for stamp in self.sent}
        for status in self.statuses:
            if (stamp := stamp_ns(status.header.stamp)) in said:
                said[stamp].append(status.state)
        return said


def written(path, messages):
    with BagWriter(path) as bag:
        for message in sorted(messages, key=lambda m: m.stamp_ns):
            bag.write(message)
    return path


def answers(chain) -> list[str]:
    """The only answer to each image, in order."""
    said = [[state for state in states if state != "waiting"] for states in chain.states().values()]
    assert [len(each) for each in said] == [1] * len(said)
    return [each[0] for each in said]


def test_a_gap_in_the_transforms_and_images_before_and_after_them(graph, tmp_path, simulated_sequence):
    """A bag whose arm came 2.5 s after the camera, had a gap of 2 s, and left 0.4 s earlier, at 10 Hz."""
    sequence = simulated_sequence(n=68)
    present = {*sequence.stamps_ns[25:40].tolist(), *sequence.stamps_ns[60:65].tolist()}
    messages = [m for m in sequence_messages(sequence) if m.topic != "/tf" or m.stamp_ns in present]
    chain = Chain(graph, use_sim_time=True, transform_timeout=10.0)
    node = replay(graph, written(tmp_path / "x.mcap", messages), **PACED, clock=True)
    play(graph, node)
    assert chain.sent == sequence.stamps_ns.tolist()
    assert (node.player.frames_sent, node.player.frames_repeated, node.player.frames_lost) == (68, 0, 0)
    graph.spin_until(lambda: all(states and states[-1] != "waiting" for states in chain.states().values()))
    # what lies within the gap is interpolated over it; only before and after there is nothing
    assert answers(chain) == ["stale"] * 25 + ["ambiguous"] * 40 + ["stale"] * 3
    assert len(chain.filters[0].measurements) == 40


@pytest.mark.parametrize("late_ms", [5, 250, 1900])
def test_transforms_recorded_after_their_images(graph, tmp_path, simulated_sequence, late_ms):
    """Between this image and the next one, after the next one, or after many."""
    sequence = simulated_sequence(n=40)
    late = [
        dataclasses.replace(m, stamp_ns=m.stamp_ns + late_ms * MS) if m.topic == "/tf" else m
        for m in sequence_messages(sequence)
    ]
    chain = Chain(graph, use_sim_time=True, transform_timeout=10.0)
    node = replay(graph, written(tmp_path / "x.mcap", late), **PACED, clock=True)
    play(graph, node)
    assert chain.sent == sequence.stamps_ns.tolist()
    graph.spin_until(lambda: len(chain.filters[0].measurements) == 40, "an answer to each")
    assert answers(chain) == ["ambiguous"] * 40
    assert (node.player.frames_repeated, node.player.frames_lost) == (0, 0)


def test_transforms_that_are_slower_than_the_images(graph, tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=41)
    slow = [m for i, m in enumerate(sequence_messages(sequence)) if m.topic != "/tf" or (i - 1) // 3 % 8 == 0]
    chain = Chain(graph, use_sim_time=True, transform_timeout=10.0)
    play(graph, node := replay(graph, written(tmp_path / "x.mcap", slow), **PACED, clock=True))
    assert chain.sent == sequence.stamps_ns.tolist()
    graph.spin_until(lambda: len(chain.filters[0].measurements) == 41, "an answer to each")
    assert answers(chain) == ["ambiguous"] * 41
    assert (node.player.frames_repeated, node.player.frames_lost) == (0, 0)


def restamped(message, by_ns):
    """With the stamps of its headers moved."""
    content = typestore().deserialize_cdr(message.data, message.type_name)
    for header in [t.header for t in content.transforms] if message.topic == "/tf" else [content.header]:
        stamp = header.stamp.sec * 1000 * MS + header.stamp.nanosec + by_ns
        header.stamp.sec, header.stamp.nanosec = divmod(stamp, 1000 * MS)
    return dataclasses.replace(message, data=bytes(typestore().serialize_cdr(content, message.type_name)))


@pytest.mark.parametrize("ahead", ["/tf", "/image_raw"])
def test_an_arm_of_another_clock_makes_stale_answers_and_holds_nobody_up(graph, tmp_path, simulated_sequence, ahead):
    sequence = simulated_sequence(n=30)
    messages = [restamped(m, 60_000 * MS) if m.topic == ahead else m for m in sequence_messages(sequence)]
    chain = Chain(graph, use_sim_time=True, transform_timeout=0.5)
    node = replay(graph, written(tmp_path / "x.mcap", messages), **PACED, clock=True)
    play(graph, node)
    assert len(chain.sent) == 30
    graph.spin_until(lambda: all("stale" in states for states in chain.states().values()), "an answer to each")
    assert answers(chain) == ["stale"] * 30
    assert (node.player.frames_repeated, node.player.frames_lost) == (0, 0)


def test_what_still_waits_after_the_end_is_no_loss(graph, simulated_sequence):
    """Without /clock nobody can let the filter's time run out."""
    consumer = Consumer(graph, answers=lambda n: False)
    consumer.report_regularly()
    node = replay(graph, simulated_sequence(n=2).path, **PACED, ack_timeout=3.0)
    graph.listen(TFMessage, "/tf")
    node.start()
    for n in (1, 2):
        graph.spin_until(lambda n=n: len(consumer.received) == n, "an image")
        consumer.answer(consumer.received[-1], FilterStatus.STATE_WAITING)
    graph.spin_until(node.finished.is_set, "the end")
    assert (node.player.frames_sent, node.player.frames_lost) == (2, 0)
    assert node.player.summary().endswith("; 2 still wait for a transform that the recording does not hold")


def test_a_step_includes_the_transforms_that_its_frame_waits_for(graph, tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=4)
    late = [
        dataclasses.replace(m, stamp_ns=m.stamp_ns + 5 * MS) if m.topic == "/tf" else m
        for m in sequence_messages(sequence)
    ]
    chain = Chain(graph, use_sim_time=True, transform_timeout=10.0)
    source = written(tmp_path / "x.mcap", late)
    node = replay(graph, source, **PACED, clock=True, start_paused=True)
    clock = graph.listen(Clock, "/clock")
    node.start()
    for n in (1, 2):
        assert graph.call(Trigger, "replay/step", Trigger.Request()).success
        graph.spin_until(lambda n=n: len(chain.filters[0].measurements) == n, "the frame")
        graph.spin_for(0.2)
        assert chain.sent == sequence.stamps_ns[:n].tolist()
        assert stamp_ns(clock[-1].clock) <= sequence.stamps_ns[n]
