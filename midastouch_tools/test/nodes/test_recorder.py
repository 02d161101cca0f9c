"""The recorder over real DDS: what is published is in the bag, to the byte, and the bag is whole or absent."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
import types

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Writer
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_msgs.msg import FilterStatus, TactileCode
from midastouch_tools.bags.images import read_bag
from midastouch_tools.bags.messages import Topic
from midastouch_tools.bags.reader import bag_messages, bag_metadata, bag_topics
from midastouch_tools.nodes.recorder import TOPICS, Recorder
from midastouch_tools.nodes.replay import Replay

pytestmark = pytest.mark.dds


def test_a_replayed_sequence_is_recorded_frame_by_frame(graph, tmp_path, simulated_sequence):
    sequence = simulated_sequence(n=8)
    path = tmp_path / "recorded.mcap"
    node = graph.add(Replay, {"source": str(sequence.path), "rate": 0.0, "wait_for_subscribers": 1})
    recorder = graph.add(Recorder, {"path": str(path)}, metadata={"object": "test_object"})
    graph.spin_until(
        lambda: all(p.get_subscription_count() for p in node.publishers if p.topic_name in recorder.counts),
        "the recorder to be connected",
    )
    node.start()
    graph.spin_until(lambda: recorder.counts["/image_raw"] == recorder.counts["/tf"] == 8, "all frames")
    assert not path.exists()
    graph.remove_all()
    frames = list(read_bag(path))
    assert [frame.stamp_ns for frame in frames] == sequence.stamps_ns.tolist()
    for i, frame in enumerate(frames):
        np.testing.assert_array_equal(frame.image, sequence.image(i))
        np.testing.assert_allclose(frame.object_from_gel_true, sequence.poses_true[i], atol=1e-9)
    assert bag_metadata(path) == {"object": "test_object"}
    assert {t.name: t.latched for t in bag_topics(path)}["/tf_static"]


def test_a_bag_is_named_after_the_time(graph, tmp_path):
    graph.add(Recorder, {"path": str(tmp_path / "100%d" / "run_%Y.mcap")})
    years = {time.strftime("%Y")}
    graph.remove_all()
    years.add(time.strftime("%Y"))
    (bag,) = (tmp_path / "100%d").iterdir()
    assert bag.name in {f"run_{year}.mcap" for year in years}


def test_custom_messages_and_a_latched_one_sent_before(graph, tmp_path):
    path = tmp_path / "bag"
    topics = [topic for topic in TOPICS if topic.name in ("/tactile/code", "/filter_status")]
    status = FilterStatus(state="lost", reason="test", skipped_names=["a"], skipped_counts=[2**40])
    graph.companion.create_publisher(FilterStatus, "filter_status", qos.latched()).publish(status)
    recorder = graph.add(Recorder, {"path": str(path)}, topics=topics)
    codes = graph.publisher(TactileCode, "tactile/code")
    codes.publish(TactileCode(in_contact=True, contact_area=1e-5, code=[0.6, 0.8], network_id="net"))
    graph.spin_until(lambda: all(recorder.counts.values()), "both messages")
    graph.remove_all()
    with AnyReader([path]) as reader:
        messages = {c.topic: reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()}
    assert messages["/filter_status"].reason == "test"
    assert messages["/filter_status"].skipped_counts.tolist() == [2**40]
    np.testing.assert_allclose(messages["/tactile/code"].code, [0.6, 0.8])


def test_sim_time_stamps_and_what_came_before_the_clock(graph, tmp_path):
    path = tmp_path / "x.mcap"
    topics = [Topic("/image_raw", "sensor_msgs/msg/Image")]
    recorder = graph.add(Recorder, {"path": str(path), "use_sim_time": True}, topics=topics)
    images, clock = graph.publisher(Image, "image_raw"), graph.publisher(Clock, "/clock")
    images.publish(Image(header=Header(frame_id="early")))
    graph.spin_until(lambda: recorder.counts["/image_raw"] == 1, "the early image")
    for n, second in ((2, 5), (3, 7)):
        clock.publish(Clock(clock=Time(sec=second)))
        graph.spin_until(lambda s=second: recorder.get_clock().now().nanoseconds == s * 10**9, "the time")
        images.publish(Image())
        graph.spin_until(lambda n=n: recorder.counts["/image_raw"] == n, "the image")
    graph.remove_all()
    assert [message.stamp_ns for message in bag_messages(path)] == [5 * 10**9, 5 * 10**9, 7 * 10**9]


@pytest.mark.usefixtures("brisk_health")
def test_what_comes_before_the_clock_does_not_fill_the_memory(graph, tmp_path, monkeypatch):
    monkeypatch.setattr("midastouch_tools.nodes.recorder.MOST_EARLY", 1000)
    path = tmp_path / "x.mcap"
    topics = [Topic("/image_raw", "sensor_msgs/msg/Image"), Topic("/filter_status", TYPE_OF_STATUS, latched=True)]
    recorder = graph.add(Recorder, {"path": str(path), "use_sim_time": True}, topics=topics)
    reports = graph.listen(DiagnosticArray, "/diagnostics")
    images, statuses = graph.publisher(Image, "image_raw"), graph.publisher(FilterStatus, "filter_status", latched=True)
    for _ in range(10):
        images.publish(Image(data=bytes(300)))
    graph.spin_until(
        lambda: any("nothing publishes /clock" in s.message for r in reports for s in r.status), "a warning"
    )
    statuses.publish(FilterStatus(reason="x" * 1000))
    graph.spin_until(lambda: recorder.counts["/filter_status"], "the status")
    assert 0 < recorder.counts["/image_raw"] < 4
    clock = graph.publisher(Clock, "/clock")
    clock.publish(Clock(clock=Time(sec=5)))
    graph.spin_until(lambda: recorder.get_clock().now().nanoseconds, "the time")
    graph.remove_all()
    assert len(list(bag_messages(path))) == sum(recorder.counts.values())


def test_a_lost_folder_ends_the_recording_and_not_the_node(graph, tmp_path):
    folder = tmp_path / "stick"
    recorder = graph.add(Recorder, {"path": str(folder / "x.mcap")})
    shutil.rmtree(folder)
    graph.spin_until(lambda: recorder.failure, "the reason")
    assert str(folder) in recorder.failure
    assert "the recording is lost" in recorder.failure


@pytest.mark.slow
def test_a_closed_terminal_does_not_cost_the_recording(graph, tmp_path):
    path = tmp_path / "x.mcap"
    node = [sys.executable, "-m", "midastouch_tools.nodes.recorder", "--ros-args", "-p", "min_free:=0.0"]
    running = subprocess.Popen(["env", "--default-signal=HUP", *node, "-p", f"path:={path}"])
    codes = graph.publisher(TactileCode, "/tactile/code")
    reports = graph.listen(DiagnosticArray, "/diagnostics")
    codes.publish(TactileCode(network_id="kept"))
    graph.spin_until(lambda: ("/tactile/code", "1") in told(reports), "the message in the recorder's counts")
    running.send_signal(signal.SIGHUP)
    assert running.wait(timeout=120) == 0
    assert "/tactile/code" in {message.topic for message in bag_messages(path)}


def told(reports) -> set[tuple[str, str]]:
    return {(value.key, value.value) for report in reports for status in report.status for value in status.values}


TYPE_OF_STATUS = "midastouch_msgs/msg/FilterStatus"


def test_the_topics_are_those_of_its_namespace(graph, tmp_path):
    path = tmp_path / "x.mcap"
    topics = [topic for topic in TOPICS if topic.name in ("/tactile/code", "/tf")]
    recorder = graph.add(Recorder, {"path": str(path)}, topics=topics, namespace="left")
    codes, moving = graph.publisher(TactileCode, "/left/tactile/code"), graph.publisher(TFMessage, "/tf")
    codes.publish(TactileCode())
    moving.publish(TFMessage())
    graph.spin_until(lambda: all(recorder.counts.values()), "both messages")
    graph.remove_all()
    assert {message.topic for message in bag_messages(path)} == {"/left/tactile/code", "/tf"}


CODES = [Topic("/tactile/code", "midastouch_msgs/msg/TactileCode")]


@pytest.mark.usefixtures("brisk_health")
def test_a_nearly_full_disk_ends_recording_with_a_whole_bag(graph, tmp_path, monkeypatch):
    path = tmp_path / "x.mcap"
    recorder = graph.add(Recorder, {"path": str(path), "min_free": 100.0}, topics=CODES)
    reports = graph.listen(DiagnosticArray, "/diagnostics")
    codes = graph.publisher(TactileCode, "tactile/code")
    codes.publish(TactileCode(network_id="kept"))
    graph.spin_until(lambda: recorder.counts["/tactile/code"] == 1, "the message")
    room = types.SimpleNamespace(free=99 * 2**20)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: room)
    graph.spin_until(lambda: recorder.failure, "the end of the recording")
    assert f"{tmp_path} has 99 MiB left" in recorder.failure
    codes.publish(TactileCode(network_id="too late"))
    graph.spin_until(lambda: any(s.level == b"\x02" for r in reports for s in r.status), "the error")
    graph.remove_all()
    assert len(list(bag_messages(path))) == 1


@pytest.mark.parametrize("when", ["writing", "completing"])
def test_a_full_disk_is_said_and_leaves_nothing_behind(graph, tmp_path, monkeypatch, when):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "x.mcap"
    recorder = graph.add(Recorder, {"path": str(path), "min_free": 0.0}, topics=CODES)
    codes = graph.publisher(TactileCode, "tactile/code")
    codes.publish(TactileCode(network_id="a"))
    graph.spin_until(lambda: recorder.counts["/tactile/code"] == 1, "the message")
    monkeypatch.setattr(Writer, "write" if when == "writing" else "close", full)
    monkeypatch.setattr(Writer, "abort", full)  # which writes what it still has
    if when == "writing":
        codes.publish(TactileCode(network_id="b"))
        graph.spin_until(lambda: recorder.failure, "the error")
    graph.remove_all()
    assert recorder.failure.startswith(f"{path}: No space left on device")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("parameters", "topics", "message"),
    [
        ({}, TOPICS, "'path' is empty"),
        ({"path": "{tmp}/thesis.txt"}, TOPICS, "exists already; name another bag"),
        ({"path": "{tmp}/x"}, [Topic("/a", "moon_msgs/msg/Cheese")], "install moon_msgs"),
        ({"path": "{tmp}/x"}, [Topic("/a", "cheese")], "'cheese' is not known"),
    ],
)
def test_what_cannot_be_recorded_is_refused(graph, tmp_path, parameters, topics, message):
    (tmp_path / "thesis.txt").write_text("precious")
    parameters = {key: value.format(tmp=tmp_path) for key, value in parameters.items()}
    with pytest.raises(InputError, match=message):
        graph.add(Recorder, parameters, topics=topics)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.txt"]
