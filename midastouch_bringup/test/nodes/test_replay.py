"""The replay over real DDS: every frame, in order, with its transforms; control; and its ends."""

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

# The filter node's stand-ins are beside its own tests.
sys.path.append(str(Path(__file__).resolve().parents[3] / "midastouch_filter/test/nodes"))

from filter_fakes import code_msg, loader_of

from midastouch_bringup.bags import write_bag
from midastouch_bringup.messages import BASE_FROM_OBJECT
from midastouch_bringup.nodes.replay import Replay
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_filter.transforms import TransformBuffer
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_perception.errors import InputError
from midastouch_perception.ros import qos
from midastouch_perception.ros.conversions import image_from_msg, stamp_from_ns, stamp_ns, transform_from_msg

pytestmark = pytest.mark.dds
MS = 1_000_000


def replay(graph, source, **parameters):
    return graph.add(Replay, {"source": str(source), "rate": 0.0, **parameters})


def play(graph, node):
    node.start()
    graph.spin_until(node.finished.is_set, "the end of the replay")


def stamps(messages):
    return [stamp_ns(message.header.stamp) for message in messages]


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
    buffer = TransformBuffer()
    for message in moving:
        for t in message.transforms:
            stamp = stamp_ns(t.header.stamp)
            buffer.insert(t.header.frame_id, t.child_frame_id, stamp, transform_from_msg(t.transform))
    for i, image in enumerate(images):
        np.testing.assert_array_equal(image_from_msg(image), sequence.image(i))
        assert image.header.frame_id == "digit_optical_frame"
        stamp = stamp_ns(image.header.stamp)
        measured = buffer.lookup("base_link", "digit_gel_frame", stamp)
        np.testing.assert_allclose(measured, BASE_FROM_OBJECT @ sequence.poses_measured[i], atol=1e-9)
        truth = buffer.lookup("object_ground_truth", "digit_gel_ground_truth", stamp)
        np.testing.assert_allclose(truth, sequence.poses_true[i], atol=1e-9)
    assert (node.frames_sent, node.frames_lost, node.error) == (6, 0, None)


class Consumer:
    """Answers images with filter states, as slowly and as badly as a test wants."""

    def __init__(self, graph, answers):
        self.received = []
        self._answers = answers  # of the n-th image received: whether it is answered
        self.node = graph.companion
        self.statuses = self.node.create_publisher(FilterStatus, "filter_status", qos.latched(10))
        self.node.create_subscription(Image, "image_raw", self._on_image, qos.stream_subscriber())

    def _on_image(self, image):
        self.received.append(stamp_ns(image.header.stamp))
        if self._answers(len(self.received)):
            self.statuses.publish(FilterStatus(header=Header(stamp=image.header.stamp), state="ambiguous"))


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


def test_waits_for_its_listeners(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=2).path, wait_for_subscribers=2)
    first = graph.listen(Image, "image_raw")
    node.start()
    graph.spin_for(0.3)
    assert not first
    second = graph.listen(Image, "image_raw")
    graph.spin_until(lambda: len(first) == len(second) == 2, "both frames at both listeners")


def test_pause_step_and_resume(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=5).path, start_paused=True)
    images = graph.listen(Image, "image_raw")
    node.start()
    graph.spin_for(0.2)
    assert not images
    for n in (1, 2):
        assert graph.call(Trigger, "replay/step", Trigger.Request()).success
        graph.spin_until(lambda n=n: len(images) == n, "one frame")
    graph.spin_for(0.2)
    assert len(images) == 2
    assert graph.call(Trigger, "replay/resume", Trigger.Request()).success
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(images) == 5, "all frames")
    refused = graph.call(Trigger, "replay/step", Trigger.Request())
    assert (refused.success, refused.message) == (False, "not paused; call pause first")
    assert graph.call(Trigger, "replay/pause", Trigger.Request()).success


def set_parameter(graph, name: str, value: float) -> SetParametersResult:
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    return graph.call(SetParameters, "replay/set_parameters", request).results[0]


def test_seek_goes_anywhere_and_keeps_the_pause(graph, simulated_sequence):
    sequence = simulated_sequence(n=10)
    node = replay(graph, sequence.path, start_paused=True, clock=True)
    images, clock = graph.listen(Image, "image_raw"), graph.listen(Clock, "/clock")
    node.start()
    wanted = []
    for frame in (7, 2, 9, 0):
        offset = (sequence.stamps_ns[frame] - sequence.stamps_ns[0]) / 1e9
        assert set_parameter(graph, "seek_to", float(offset)).successful
        assert graph.call(Trigger, "replay/step", Trigger.Request()).success
        wanted.append(int(sequence.stamps_ns[frame]))
        graph.spin_until(lambda: len(images) == len(wanted), "the frame at that place")
        graph.spin_for(0.1)
        assert stamps(images) == wanted
    graph.spin_until(lambda: len(clock) == len(wanted), "the clock")
    assert [stamp_ns(message.clock) for message in clock] == wanted
    assert graph.call(Trigger, "replay/resume", Trigger.Request()).success
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(images) == 4 + 9, "the rest")


def test_a_seek_while_an_answer_is_awaited_loses_no_frame(graph, simulated_sequence):
    sequence = simulated_sequence(n=6)
    consumer = Consumer(graph, answers=lambda n: n > 1)  # the first image is never answered
    node = replay(graph, sequence.path, ack_topic="filter_status", wait_for_subscribers=1, ack_timeout=600.0)
    graph.listen(TFMessage, "/tf")
    node.start()
    graph.spin_until(lambda: consumer.received, "the first image")
    offset = (sequence.stamps_ns[4] - sequence.stamps_ns[0]) / 1e9
    assert set_parameter(graph, "seek_to", float(offset)).successful
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns[[0, 4, 5]].tolist()
    assert node.frames_lost == 0


def test_the_rate_and_the_loop_change_while_it_plays(graph, simulated_sequence):
    sequence = simulated_sequence(n=4)
    node = replay(graph, sequence.path, rate=0.001, loop=True)
    images = graph.listen(Image, "image_raw")
    node.start()
    graph.spin_until(lambda: images, "the first image")
    graph.spin_for(0.3)
    assert len(images) == 1
    for name, value in (("rate", -1.0), ("rate", math.inf), ("seek_to", -1.0), ("start_paused", True)):
        refused = set_parameter(graph, name, value)
        assert not refused.successful
        assert refused.reason
    assert set_parameter(graph, "rate", 1000.0).successful
    graph.spin_until(lambda: len(images) > 6, "the second round")
    assert set_parameter(graph, "loop", False).successful
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(images) % 4 == 0, "all of the last round")


def test_the_filter_starts_again_once_per_loop(graph, simulated_sequence):
    """The whole way: replay, codes made of its images, the filter's own node with a filter that counts."""
    sequence, filters = simulated_sequence(n=20), []
    parameters = {"mesh": "/data/a.ply", "codebook": "/data/a.npz", "queue_depth": 100, "reliable": True}
    graph.add(lambda **options: ParticleFilterNode(load=loader_of(filters), **options), parameters)
    codes = graph.companion.create_publisher(TactileCode, "tactile/code", qos.stream_publisher(100))
    images = []

    def feel(image):
        images.append(image)
        codes.publish(code_msg(stamp_ns(image.header.stamp)))

    graph.companion.create_subscription(Image, "image_raw", feel, qos.stream_subscriber(100, reliable=True))
    node = replay(graph, sequence.path, loop=True, ack_topic="filter_status", wait_for_subscribers=1, ack_timeout=600.0)
    node.start()
    graph.spin_until(lambda: len(images) >= 41, "the third round")
    assert set_parameter(graph, "loop", False).successful
    graph.spin_until(node.finished.is_set, "the end")
    rounds = len(images) // 20
    assert len(images) == 20 * rounds
    assert filters[0].starts == ["uniform"] * rounds
    assert len(filters[0].measurements) == 20 * rounds


def test_what_the_keys_do(graph, simulated_sequence):
    sequence = simulated_sequence(n=80)  # 7.9 s
    node = replay(graph, sequence.path, start_paused=True, rate=1.0, start_offset=7.0)
    images = graph.listen(Image, "image_raw")
    keys = node.control.keys()
    node.start()
    keys["right"]()
    graph.spin_until(lambda: len(images) == 1, "one frame")
    assert node.position == pytest.approx(7.0)
    keys["left"]()
    keys["right"]()
    graph.spin_until(lambda: len(images) == 2, "a frame 5 s earlier")
    assert node.position == pytest.approx(2.0)
    for _ in range(3):
        keys["up"]()
    keys["down"]()
    assert node.get_parameter("rate").value == pytest.approx(1.25**2)
    for _ in range(40):
        keys["up"]()
    assert node.get_parameter("rate").value == 1000.0
    keys[" "]()
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(images) == 61, "the rest")
    assert stamps(images)[:2] == sequence.stamps_ns[[70, 20]].tolist()


def test_an_offset_beyond_the_end_is_said(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=3).path, start_offset=100.0, loop=True)
    play(graph, node)
    assert "nothing to play from 100 s on" in str(node.error)


def test_clock_runs_with_the_recording_and_jumps_back_once_per_loop(graph, simulated_sequence):
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


def test_start_offset_leaves_out_the_beginning_but_no_static_transform(graph, simulated_sequence):
    sequence = simulated_sequence(n=6)
    node = replay(graph, sequence.path, start_offset=0.25)
    images, static = graph.listen(Image, "image_raw"), graph.listen(TFMessage, "/tf_static", latched=True)
    play(graph, node)
    graph.spin_until(lambda: len(images) == 3 and static, "the rest")
    assert stamps(images) == sequence.stamps_ns[3:].tolist()


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
    ("source", "message"), [("", "'source' is empty"), ("/nowhere/slide", "no such sequence folder")]
)
def test_bad_sources_are_refused_at_the_start(graph, source, message):
    with pytest.raises(InputError, match=message):
        replay(graph, source)


def test_destroying_ends_a_replay_that_waits(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=2).path, wait_for_subscribers=9)
    node.start()
    graph.remove_all()
    assert node.finished.is_set()


def process(graph, *parameters):
    """The executable, on the graph's DDS domain."""
    arguments = [part for parameter in parameters for part in ("-p", parameter)]
    domain = str(graph.companion.context.get_domain_id())
    return subprocess.Popen(
        [sys.executable, "-m", "midastouch_bringup.nodes.replay", "--ros-args", *arguments],
        env=os.environ | {"ROS_DOMAIN_ID": domain},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_the_executable_ends_by_itself_with_0_and_with_2_on_bad_input(graph, simulated_sequence):
    sequence = simulated_sequence(n=3)
    good = process(graph, f"source:={sequence.path}", "rate:=0.0")
    bad = process(graph, "source:=/nowhere/slide")
    out, err = good.communicate(timeout=60)
    assert good.returncode == 0, err
    assert "sent 3 frames, 0 repeated, 0 lost" in out + err
    out, err = bad.communicate(timeout=60)
    assert bad.returncode == 2
    assert err.strip() == "/nowhere/slide: no such sequence folder; check the path"
    sequence.image_paths[1].write_bytes(b"")
    damaged = process(graph, f"source:={sequence.path}", "rate:=0.0")
    out, err = damaged.communicate(timeout=60)
    assert damaged.returncode == 2
    assert err.strip().endswith("1.jpg: not a readable image; get the file again")


def test_an_interrupt_ends_the_executable_cleanly(graph, simulated_sequence):
    running = process(graph, f"source:={simulated_sequence(n=3).path}", "loop:=true", "rate:=2.0")
    images = graph.listen(Image, "image_raw")
    graph.spin_until(lambda: images, "a first frame")
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 0, err
    assert "Traceback" not in err
