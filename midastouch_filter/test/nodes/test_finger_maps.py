"""Each code of a finger gets the penetration map of its own cloud."""

from __future__ import annotations

import types

import numpy as np
import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench, skipped
from filter_fakes import cloud_msg, code_msg, loader_of
from sensor_msgs.msg import PointCloud2
from tf_messages import tf_msg

from midastouch_common.message_arrays import SECOND
from midastouch_filter.core.touch import reduced_penetration
from midastouch_filter.nodes import finger_topics
from midastouch_filter.nodes.finger_topics import MapSource
from midastouch_filter.nodes.particle_filter import ParticleFilterNode

pytestmark = pytest.mark.dds


def penetration(depth: float) -> np.ndarray:
    out = np.zeros((160, 120), np.float32)
    out[60:80, 40:60] = depth
    return out


def test_each_code_gets_the_map_of_its_own_cloud(graph, monkeypatch):
    monkeypatch.setattr(finger_topics, "CLOUD_TIMEOUT", 30.0)
    bench = Bench(graph, **OBJECT, refinement=True)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    depths = [1e-3, 5e-4, 2e-4]
    for stamp in (1, 2, 3):
        bench.tf.publish(tf_msg(stamp * SECOND, T_BASE_OBJ))
    for stamp in (1, 2, 3):
        bench.codes.publish(code_msg(stamp * SECOND))
    for stamp, depth in zip((1, 2, 3), depths, strict=True):
        clouds.publish(cloud_msg(stamp * SECOND, penetration(depth)))
    graph.spin_until(lambda: len(bench.statuses) == 3)
    for measurement, depth in zip(bench.filter.measurements, depths, strict=True):
        np.testing.assert_allclose(measurement.penetration, reduced_penetration(penetration(depth)), atol=1e-7)


def test_clouds_wait_with_codes_whose_transforms_are_late(graph):
    bench = Bench(graph, **OBJECT, refinement=True)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    stamps = [SECOND + 16_000_000 * k for k in range(30)]
    for stamp in stamps:
        clouds.publish(cloud_msg(stamp, penetration(1e-3)))
        bench.codes.publish(code_msg(stamp))
    for stamp in (stamps[0], stamps[-1]):
        bench.tf.publish(tf_msg(stamp, T_BASE_OBJ))
    graph.spin_until(lambda: len(bench.statuses) == len(stamps))
    assert len(bench.filter.measurements) == len(stamps)
    assert all(measurement.penetration is not None for measurement in bench.filter.measurements)


def map_source(publishers: int, reliable: bool):
    """A source of maps whose node knows so many publishers, and its callback."""
    callbacks = []
    node = types.SimpleNamespace(
        create_subscription=lambda kind, topic, callback, profile: callbacks.append(callback),
        count_publishers=lambda topic: publishers,
    )
    return MapSource(node, 1, reliable, on_cloud=lambda: None, on_bad=lambda reason: None), callbacks[0]


@pytest.mark.parametrize(("publishers", "reliable"), [(1, False), (1, True), (0, True)])
def test_a_cloud_whose_successor_is_there_is_not_waited_for(publishers, reliable):
    penetrations, on_points = map_source(publishers, reliable)
    on_points(cloud_msg(2 * SECOND, penetration(1e-3)))
    assert [penetrations.awaited(stamp * SECOND, 0.0) for stamp in (1, 2, 3)] == [False, False, True]


def test_only_the_first_code_of_a_replay_waits_for_clouds():
    penetrations, _ = map_source(0, reliable=True)
    assert [penetrations.awaited(SECOND, waited) for waited in (0.0, 4.9, 5.0)] == [True, True, False]
    assert not penetrations.awaited(2 * SECOND, 0.0), "codes alone are replayed"
    live, _ = map_source(0, reliable=False)
    assert not live.awaited(SECOND, 0.0)


def test_a_lost_or_broken_cloud_costs_the_map_only(graph):
    bench = Bench(graph, **OBJECT, refinement=True)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    clouds.publish(cloud_msg(1 * SECOND, penetration(1e-3)))
    broken = cloud_msg(3 * SECOND, penetration(1e-3))
    broken.point_step = 0
    clouds.publish(broken)
    for stamp in (1, 2, 3, 4):
        bench.frame(stamp * SECOND, T_BASE_OBJ, in_contact=stamp != 4)
    penetrations = [measurement.penetration is not None for measurement in bench.filter.measurements]
    assert penetrations == [True, False, False, False]
    status = bench.statuses[-1]
    assert skipped(status)["no_map"] == 2
    assert bench.node.diagnostics.counts["bad_clouds"] == 1


def test_without_refinement_no_clouds_are_taken(graph):
    graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), {**OBJECT, "refinement": False})
    assert graph.companion.count_subscribers("tactile/points") == 0
