"""What goes wrong around the nodes: an unplugged cable, another sensor's messages, a bag that begins again."""

from __future__ import annotations

import functools
import time

import fake_kernel
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from filter_bench import is_answer
from filter_fakes import all_finite, loader_of
from perception_fakes import FakeDepthStage, FakeTcn
from sensor_msgs.msg import Image
from slide import PATIENT, filter_parameters, image_at, tdn_parameters, transform_msg
from tf2_msgs.msg import TFMessage

from digit_driver.discovery import find_cameras
from digit_driver.nodes.digit_driver import DigitDriver
from digit_driver.v4l2_device import V4l2Camera
from midastouch_bringup.nodes.all_in_one import make_nodes
from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_tools.nodes.replay import Replay

pytestmark = pytest.mark.dds


def test_a_sensor_that_is_unplugged(graph, slide, minutes, figures, monkeypatch, tmp_path):
    """ERROR, then OK in the diagnostics; stale, then an answer from the filter; under another device number."""
    seconds, timeout = (5.0, 2.0) if minutes else (0.5, 0.3)
    monkeypatch.setattr(fake_kernel, "FRAME_PERIOD_S", 1 / 60)
    kernel = fake_kernel.FakeKernel(tmp_path)
    find = functools.partial(find_cameras, sysfs=kernel.sysfs, dev=kernel.dev)
    driver = functools.partial(DigitDriver, make_camera=functools.partial(V4l2Camera, system=kernel, find=find))
    camera = kernel.plug(fake_kernel.FakeDigit("D20001"))

    overrides = {"tdn": {}, "tcn": {}, "particle_filter": filter_parameters(slide, input_timeout=timeout)}
    graph.add_all(lambda options: make_nodes(options=options), overrides)
    statuses = graph.listen(FilterStatus, "filter_status", latched=True)
    tf = graph.publisher(TFMessage, "/tf")
    graph.companion.create_timer(0.02, lambda: tf.publish(transform_msg(slide.poses[0], time.time_ns())))
    graph.add(driver, {"reconnect_timeout": 0.1, "diagnostics_period": 0.1})
    reports = graph.listen(DiagnosticArray, "/diagnostics")

    def driver_says(level: bytes) -> bool:
        levels = [s.level for report in reports for s in report.status if s.name.startswith("digit_driver")]
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
        ends[side] = images, graph.listen(FilterStatus, f"/{side}/filter_status", latched=True, wanted=is_answer)
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
    graph.spin_until(lambda: replay.player.frames_sent >= loops * n, f"{loops} loops")
    sent, restarts = replay.player.frames_sent, len(filters[0].starts)
    figures["looped_bag"] = {
        "loops": sent / n,
        "frames": sent,
        "lost": replay.player.frames_lost,
        "restarts": restarts,
        "refused_transforms": running.diagnostics.counts.get("bad_transforms", 0),
    }
    assert replay.player.frames_lost == 0
    assert restarts - sent // n in (0, 1), "the next loop may have begun"
    assert "bad_transforms" not in running.diagnostics.counts
