"""What goes wrong around the nodes: cable, messages, time, disk. Nothing dies, nothing published is not finite."""

from __future__ import annotations

import contextlib
import functools
import resource
import time
from pathlib import Path

import fake_kernel
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from filter_fakes import all_finite, cloud_msg, code_msg, loader_of, pose_msg
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from perception_fakes import FakeDepthStage, FakeTcn
from sensor_msgs.msg import Image, PointCloud2
from slide import Slide, transform_msg
from spoil import spoil
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from digit_driver import sources
from digit_driver.discovery import find_digits
from digit_driver.nodes.digit_driver import DigitDriver
from digit_driver.v4l2_device import V4l2Digit
from midastouch_bringup.bags import write_bag
from midastouch_bringup.datasets import write_sequence
from midastouch_bringup.evaluation.result_file import write_json
from midastouch_bringup.nodes.all_in_one import make_nodes
from midastouch_bringup.nodes.replay import Replay
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_filter.state import STATES
from midastouch_msgs.msg import FilterStatus, PoseModes
from midastouch_perception.codebook import Codebook
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_perception.ros.conversions import image_to_msg, stamp_from_ns, stamp_ns
from midastouch_perception.sensor_model import SensorModel

SECOND = 1_000_000_000
PATIENT = {"input_timeout": 1000.0}


def filter_parameters(slide: Slide, **changes) -> dict:
    own = {"mesh": str(slide.mesh), "codebook": str(slide.codebook), "max_particles": 1000, "threads": 1}
    return {**own, **changes}


def tdn_parameters(slide: Slide, **changes) -> dict:
    return {"background": str(slide.background), **changes}


def image_at(slide: Slide, k: int, stamp: int) -> Image:
    return image_to_msg(slide.images[k], "rgb8", Header(stamp=stamp_from_ns(stamp), frame_id="digit_optical_frame"))


# --------------------------------------------------------------------------- the cable


@pytest.mark.dds
def test_a_sensor_that_is_unplugged(graph, slide, minutes, figures, monkeypatch, tmp_path):
    """ERROR, then OK in the diagnostics; stale, then an answer from the filter; under another device number."""
    seconds, timeout = (5.0, 2.0) if minutes else (0.5, 0.3)
    monkeypatch.setattr(fake_kernel, "FRAME_PERIOD_S", 1 / 60)
    kernel = fake_kernel.FakeKernel(tmp_path)
    find = functools.partial(find_digits, kernel.sysfs, kernel.dev)
    monkeypatch.setattr(sources, "V4l2Digit", functools.partial(V4l2Digit, system=kernel, find=find))
    camera = kernel.plug(fake_kernel.FakeDigit("D20001"))

    overrides = {"tdn": {}, "tcn": {}, "particle_filter": filter_parameters(slide, input_timeout=timeout)}
    graph.add_all(lambda options: make_nodes(options=options), overrides)
    statuses = graph.listen(FilterStatus, "filter_status", latched=True)
    tf = graph.publisher(TFMessage, "/tf")
    graph.companion.create_timer(0.02, lambda: tf.publish(transform_msg(slide.poses[0], time.time_ns())))
    graph.add(DigitDriver, {"reconnect_timeout": 0.1, "diagnostics_period": 0.1})
    reports = graph.listen(DiagnosticArray, "/diagnostics")

    def driver_says(level: bytes) -> bool:
        levels = [s.level for report in reports for s in report.status if s.name.endswith("stream")]
        return levels[-1:] == [level]

    def answered(since: int) -> bool:
        return any(stamp_ns(s.header.stamp) > since and s.n_particles and s.state != "stale" for s in statuses)

    graph.spin_until(lambda: answered(0) and driver_says(b"\x00"), "the stream")
    kernel.unplug(camera)
    unplugged = time.monotonic()
    graph.spin_until(lambda: driver_says(b"\x02"), "the driver's ERROR")
    error_after = time.monotonic() - unplugged
    graph.spin_until(lambda: statuses[-1].state == "stale", "the filter to say stale")
    stale_after = time.monotonic() - unplugged
    graph.spin_for(max(0.0, unplugged + seconds - time.monotonic()))
    camera.number = 4
    kernel.plug(camera)
    replugged, clock = time.monotonic(), time.time_ns()
    graph.spin_until(lambda: answered(clock) and driver_says(b"\x00"), "the stream to come back")
    figures["unplugged"] = {
        "for_s": seconds,
        "error_after_s": error_after,
        "stale_after_s": stale_after,
        "back_after_s": time.monotonic() - replugged,
    }
    assert all(map(all_finite, statuses))


# --------------------------------------------------------------------------- messages


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


@pytest.mark.dds
def test_two_sensors_in_namespaces_do_not_hear_each_other(graph, slide, minutes, figures):
    frames = round(20 * minutes) if minutes else 3
    ends = {}
    for side in ("left", "right"):
        parameters = {"sensor_frame_id": f"{side}_digit_gel_frame", "queue_depth": 50, "reliable": True}
        options = {
            "tdn": tdn_parameters(slide, **parameters),
            "tcn": {"queue_depth": 50, "reliable": True},
            "particle_filter": filter_parameters(slide, **parameters, **PATIENT),
        }
        in_namespace = lambda options, side=side: make_nodes(  # noqa: E731
            options={name: {**own, "namespace": side} for name, own in options.items()}
        )
        graph.add_all(in_namespace, options)
        images = graph.publisher(Image, f"/{side}/image_raw")
        ends[side] = images, graph.listen(FilterStatus, f"/{side}/filter_status", latched=True)
    tf = graph.publisher(TFMessage, "/tf")

    def answers(side: str) -> list[int]:
        return [stamp_ns(s.header.stamp) for s in ends[side][1] if s.n_particles]

    sent = {"left": [], "right": []}
    for i in range(frames):
        for k, side in enumerate(("left", "right")):
            stamp = (10 * i + k + 1) * SECOND // 10
            tf.publish(transform_msg(slide.poses[i % len(slide.poses)], stamp, f"{side}_"))
            ends[side][0].publish(image_at(slide, i % len(slide.poses), stamp))
            sent[side].append(stamp)
            graph.spin_until(lambda side=side, stamp=stamp: stamp in answers(side), f"the answer to {side} {i}")
    for side in sent:
        assert set(answers(side)) == set(sent[side])
    figures["two_sensors"] = {side: {"sent": len(sent[side]), "answered": len(answers(side))} for side in sent}


# --------------------------------------------------------------------------- time


@pytest.mark.dds
def test_a_bag_that_loops(graph, minutes, figures, simulated_sequence):
    """One restart per loop, no frame lost, no transform refused."""
    loops, n = round(2 * minutes) if minutes else 3, 12
    filters: list = []
    tcn = FakeTcn()
    tcn.network_id = "fake"
    replayed = {"queue_depth": 100, "reliable": True, "use_sim_time": True}
    running = graph.add(
        lambda **options: ParticleFilterNode(load=loader_of(filters), **options),
        {**replayed, "mesh": "/a.ply", "codebook": "/a.npz", "input_timeout": 1000.0},
    )
    graph.add(lambda **options: TcnNode(tcn=tcn, **options), replayed)
    graph.add(lambda **options: TdnNode(depth=FakeDepthStage(), **options), replayed)
    source = {"source": str(simulated_sequence(n=n).path), "rate": 0.0, "loop": True, "clock": True}
    replay = graph.add(Replay, {**source, "ack_topic": "filter_status", "wait_for_subscribers": 1})
    replay.start()
    graph.spin_until(lambda: replay.frames_sent >= loops * n, f"{loops} loops")
    sent, restarts = replay.frames_sent, len(filters[0].starts)
    figures["looped_bag"] = {
        "loops": sent / n,
        "frames": sent,
        "lost": replay.frames_lost,
        "restarts": restarts,
        "refused_transforms": running.diagnostics.counts.get("bad_transforms", 0),
    }
    assert replay.frames_lost == 0
    assert restarts - sent // n in (0, 1), "the next loop may have begun"
    assert "bad_transforms" not in running.diagnostics.counts


# --------------------------------------------------------------------------- the disk


@contextlib.contextmanager
def no_room_beyond(size: int):
    """Any file that grows beyond `size` bytes fails, as on a full disk (EFBIG in the place of ENOSPC)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def some_sequence(path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (320, 240, 3)).astype(np.uint8)
    write_sequence(
        path,
        ((image, np.zeros((320, 240), np.float32)) for _ in range(3)),
        np.tile(np.eye(4), (3, 1, 1)),
        np.tile(np.eye(4), (3, 1, 1)),
        background=image,
        object_name="thing",
        sensor=SensorModel.load("digit_tacto"),
        noise={"sig_t": 0.0, "sig_r": 0.0},
    )


def test_a_full_disk_leaves_nothing_half_written(tmp_path, slide, simulated_sequence, figures):
    """What was there before stays, and the error names the file."""
    sequence, book = simulated_sequence(n=3), Codebook.load(slide.codebook)
    writers = {
        "book.npz": book.save,
        "result.json": lambda path: write_json(path, {"numbers": list(range(10_000))}),
        "slide.mcap": lambda path: write_bag(sequence, path),
        "bag": lambda path: write_bag(sequence, path),
        "sequence": some_sequence,
    }
    folder = tmp_path / "disk"
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    for name, write in writers.items():
        with no_room_beyond(4096), pytest.raises(OSError, match=name):
            write(folder / name)
        assert [(file.name, file.read_text()) for file in folder.iterdir()] == [("result.json", "{}")], name
    figures["full_disk"] = {"writers": list(writers), "left_behind": 0}
