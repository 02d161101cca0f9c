"""The node as a whole: one answer for every code."""

from __future__ import annotations

import time

import numpy as np
import pytest
from filter_bench import OBJECT, REPLAY, T_BASE_OBJ, Bench, skipped
from filter_fakes import FakeFilter, loader_of
from geometry_msgs.msg import PoseWithCovarianceStamped
from rcl_interfaces.msg import Log
from tf_messages import tf_msg, translation

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND, pose_from_msg, stamp_ns
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import PRESETS
from midastouch_filter.nodes.estimate_publisher import EstimatePublisher
from midastouch_filter.nodes.filter_parameters import PARAMETERS, config_of
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import PoseModes

pytestmark = pytest.mark.dds


def test_every_code_is_answered_with_stamp_and_whole_estimate(graph):
    bench = Bench(graph, **OBJECT)
    poses = graph.listen(PoseWithCovarianceStamped, "pose", latched=True)
    modes = graph.listen(PoseModes, "pose_modes")
    status = bench.frame(SECOND, T_BASE_OBJ)
    assert (status.state, status.header.frame_id, status.n_particles) == ("ambiguous", "object", 800)
    assert skipped(status)["at_rest"] == 3
    assert dict(zip(status.stage_names, status.stage_ms, strict=True)) == {"modes": 0.5}
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01))
    graph.spin_until(lambda: len(poses) == len(modes) == 2)

    assert bench.answered() == [SECOND, 2 * SECOND]
    assert bench.filter.odometry[0] is None
    np.testing.assert_allclose(bench.filter.odometry[1], translation(0.01), atol=1e-9)
    measurement = bench.filter.measurements[0]
    assert (measurement.in_contact, measurement.network_id) == (True, "fake")
    np.testing.assert_allclose(measurement.code, [0.6, 0.8], atol=1e-6)

    assert (poses[1].header.frame_id, stamp_ns(poses[1].header.stamp)) == ("object", 2 * SECOND)
    np.testing.assert_allclose(pose_from_msg(poses[1].pose.pose), translation(0.01), atol=1e-9)
    assert [m.weight for m in modes[1].modes] == [0.75, 0.25]
    covariance = np.array(poses[1].pose.covariance).reshape(6, 6)
    np.testing.assert_allclose(np.diagonal(covariance), [1e-6, 2e-6, 3e-6, 1e-4, 2e-4, 3e-4])


def test_the_deferred_update_is_done_once_the_answer_is_out(graph, monkeypatch):
    happened = []

    def noted(owner, name):
        do = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *args: (happened.append(name), do(*args))[1])

    noted(EstimatePublisher, "estimate")
    noted(FakeFilter, "deferred_update")
    bench = Bench(graph, **OBJECT)
    for k in (1, 2):
        bench.frame(k * SECOND, T_BASE_OBJ)
    graph.spin_until(lambda: len(happened) == 4, "the last reflection")
    assert happened == ["estimate", "deferred_update"] * 2


def test_silence_is_stale_once(graph, timeout_clock, brisk_health):
    bench = Bench(graph, **OBJECT)
    bench.frame(SECOND, T_BASE_OBJ)
    before = time.time_ns()
    timeout_clock.now += REPLAY["input_timeout"] + 1.0
    graph.spin_until(lambda: bench.statuses[-1].state == "stale")
    assert "no tactile/code" in bench.statuses[-1].reason
    assert before < stamp_ns(bench.statuses[-1].header.stamp) < time.time_ns(), "of no image, but of now"
    for _ in range(3):  # more than 100 ms apart, in which the node looks for silence every 50 ms
        graph.health().until("")
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"
    assert [status.state for status in bench.statuses] == ["ambiguous", "stale", "ambiguous"]


def test_code_of_another_network_is_refused_with_a_reason(graph):
    bench = Bench(graph, **OBJECT)
    status = bench.frame(SECOND, T_BASE_OBJ, network_id="other")
    assert status.state == "stale"
    assert "network other" in status.reason
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"


@pytest.mark.parametrize(
    ("parameters", "complaint"),
    [
        ({"min_particles": 500}, "'min_particles' is gone: hypotheses are Gaussians"),
        ({"calibration": False}, "'calibration' is gone: .*drift_translation and drift_rotation"),
        ({"relief_noise": 2e-4}, "'relief_noise' is gone: it is penetration_noise, a setting of FilterConfig"),
        ({"keyframe_spacing": 0.02}, "'keyframe_spacing' is gone: .*FilterConfig"),
        ({"initial_pose.x": 0.02}, "'initial_pose.x' is gone: initial_pose is one list now"),
        ({"suggestion_count": 2}, "'suggestion_count' is gone: .*count"),
        ({"codebook": "/data/mug.npz"}, "no mesh given"),
        ({"mesh": "/bad.ply", "codebook": "/a.npz"}, "not a mesh"),
    ],
)
def test_bad_parameters_fail_at_start(graph, parameters, complaint):
    with pytest.raises(InputError, match=complaint):
        graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), parameters)


def test_a_preset_gives_defaults_and_what_is_set_goes_over_it(graph):
    fast = PRESETS["fast"]
    node = graph.add(ParticleFilterNode, {"preset": "fast", "alignments_per_second": 1234, "autostart": False})
    config = config_of(node.parameters)
    assert config.alignments_per_second == 1234 != fast["alignments_per_second"]
    assert config.refined_modes == fast["refined_modes"] != FilterConfig().refined_modes
    assert node.get_parameter("refined_modes").value == config.refined_modes


def test_there_are_no_more_parameters_than_a_user_can_oversee():
    assert len(PARAMETERS) <= 40


def test_the_paper_preset_hears_no_maps(graph):
    """Its filter knows codes only, so no code waits for a map."""
    made = []

    def load(*given):
        made.append(given[-1])
        return loader_of([])(*given)

    bench = Bench(graph, load=load, **OBJECT, preset="paper", refinement=True)
    assert bench.frame(SECOND, T_BASE_OBJ).state == "ambiguous"
    assert made == [True]
    assert graph.companion.count_subscribers("tactile/points") == 0


@pytest.mark.usefixtures("brisk_health")
def test_what_keeps_it_from_a_pose_is_logged_once(graph, monkeypatch):
    """At a terminal nobody sees the diagnostics."""
    monkeypatch.setattr("midastouch_common.ros.diagnostics.LASTING_S", 0.2)
    bench = Bench(graph)
    logs = graph.listen(Log, "/rosout", latched=True, wanted=lambda log: "no pose" in log.msg)
    no_transform = "no TF from base_link to digit_gel_frame, so no pose: "
    graph.spin_until(lambda: any(log.msg.startswith(no_transform) for log in logs), "that TF is missing")
    assert sum("no object, so no pose" in log.msg for log in logs) == 1
    bench.frame(SECOND)
    graph.spin_until(lambda: any(log.msg.startswith(f"over: {no_transform}") for log in logs), "its end")
    assert sum(no_transform in log.msg for log in logs) == 2


@pytest.mark.usefixtures("brisk_health")
def test_stamps_without_transforms_are_logged(graph, monkeypatch):
    monkeypatch.setattr("midastouch_common.ros.diagnostics.LASTING_S", 0.2)
    bench = Bench(graph, **OBJECT)
    logs = graph.listen(Log, "/rosout", latched=True, wanted=lambda log: "no TF from" in log.msg)
    bench.tf.publish(tf_msg(SECOND, T_BASE_OBJ))
    bench.delay(9 * SECOND)
    graph.spin_until(lambda: logs, "that the stamps differ")
    assert "no TF from base_link to digit_gel_frame, so no pose: no transform yet: " in logs[0].msg
