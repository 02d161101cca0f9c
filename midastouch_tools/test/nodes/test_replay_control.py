"""Pause, steps, pace, place and keys of a replay over real DDS."""

import math

import pytest
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from replay_rig import begun, replay, stamps
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from midastouch_common.message_arrays import stamp_ns
from midastouch_tools.bags.writer import write_bag

pytestmark = pytest.mark.dds


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


def test_seek_goes_anywhere_and_keeps_the_pause(graph, simulated_sequence):
    sequence = simulated_sequence(n=10)
    node = replay(graph, sequence.path, start_paused=True, clock=True)
    images, clock = graph.listen(Image, "image_raw"), graph.listen(Clock, "/clock")
    node.start()
    wanted = []
    for frame in (7, 2, 9, 0):
        offset = (sequence.stamps_ns[frame] - sequence.stamps_ns[0]) / 1e9
        assert graph.set_parameter("replay", "seek_to", float(offset)).successful
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
    # the first image is never answered
    consumer, node = begun(graph, sequence.path, answers=lambda n: n > 1, ack_timeout=600.0)
    graph.spin_until(lambda: consumer.received, "the first image")
    offset = (sequence.stamps_ns[4] - sequence.stamps_ns[0]) / 1e9
    assert graph.set_parameter("replay", "seek_to", float(offset)).successful
    graph.spin_until(node.finished.is_set, "the end")
    assert consumer.received == sequence.stamps_ns[[0, 4, 5]].tolist()
    assert node.player.frames_lost == 0


@pytest.mark.parametrize("form", ["sequence", "bag"])
def test_a_seek_beyond_the_end_is_refused_with_the_reason(graph, tmp_path, simulated_sequence, form):
    sequence = simulated_sequence(n=21)  # 2 s
    source = sequence.path
    if form == "bag":
        write_bag(sequence, source := tmp_path / "x.mcap")
    replay(graph, source, start_paused=True).start()
    refused = graph.set_parameter("replay", "seek_to", 999.0)
    assert not refused.successful
    assert all(words in refused.reason for words in ("seek_to", "999 s", "2.000 s"))
    kept = graph.call(GetParameters, "replay/get_parameters", GetParameters.Request(names=["seek_to"]))
    assert kept.values[0].double_value == 0.0
    assert graph.set_parameter("replay", "seek_to", 2.0).successful


def test_the_rate_and_the_loop_change_while_it_plays(graph, simulated_sequence):
    sequence = simulated_sequence(n=4)
    node = replay(graph, sequence.path, rate=0.001, loop=True)
    images = graph.listen(Image, "image_raw")
    node.start()
    graph.spin_until(lambda: images, "the first image")
    graph.spin_for(0.2)
    assert len(images) == 1
    for name, value in (("rate", -1.0), ("rate", math.inf), ("seek_to", -1.0), ("start_paused", True)):
        refused = graph.set_parameter("replay", name, value)
        assert not refused.successful
        assert refused.reason
    assert graph.set_parameter("replay", "rate", 1000.0).successful
    graph.spin_until(lambda: len(images) > 6, "the second round")
    assert graph.set_parameter("replay", "loop", False).successful
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(images) % 4 == 0, "all of the last round")


def test_what_the_keys_do(graph, simulated_sequence):
    sequence = simulated_sequence(n=80)  # 7.9 s
    node = replay(graph, sequence.path, start_paused=True, rate=1.0)
    images, log = graph.listen(Image, "image_raw"), graph.listen(Log, "/rosout", latched=True)
    keys = node.control.keys()
    assert graph.set_parameter("replay", "seek_to", 7.0).successful
    node.start()
    keys["right"]()
    graph.spin_until(lambda: len(images) == 1, "one frame")
    assert node.player.position == pytest.approx(7.0)
    keys["left"]()
    keys["right"]()
    graph.spin_until(lambda: len(images) == 2, "a frame 5 s earlier")
    assert node.player.position == pytest.approx(2.0)
    for key in ("up", "up", "up", "down"):
        keys[key]()
    assert node.get_parameter("rate").value == pytest.approx(1.25**2)
    for _ in range(40):
        keys["up"]()
    assert node.get_parameter("rate").value == 1000.0
    keys[" "]()
    graph.spin_until(node.finished.is_set, "the end")
    graph.spin_until(lambda: len(images) == 61, "the rest")
    assert stamps(images)[:2] == sequence.stamps_ns[[70, 20]].tolist()
    shown = {"paused, rate 1.00; one frame", "paused, rate 1.25", "playing, rate 1000.00"}
    graph.spin_until(lambda: shown <= {entry.msg for entry in log}, "what each key did")
