from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, str(Path(__file__).parent))

from filter_fakes import DIAGONAL, SECOND, cloud_msg, code_msg, loader_of, pose_msg, tf_msg, translation

from midastouch_filter.filter import Measurement
from midastouch_filter.nodes import relief_source
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_filter.nodes.transform_source import Wait
from midastouch_filter.refinement import reduced_relief
from midastouch_filter.state import CONVERGED
from midastouch_msgs.msg import FilterStatus, PoseModes, TactileCode
from midastouch_msgs.srv import SetObject
from midastouch_perception import se3
from midastouch_perception.errors import InputError
from midastouch_perception.ros.conversions import pose_from_msg, stamp_ns, transform_from_msg

pytestmark = pytest.mark.dds
REPLAY = {"queue_depth": 100, "reliable": True, "view_rate": 0.0, "input_timeout": 1000.0}
OBJECT = {"mesh": "/data/mug.ply", "codebook": "/data/mug.npz"}
T_BASE_OBJ = translation(0.4, 0.1, 0.2)


class Bench:
    """A node with a fake filter, its inputs and the statuses it has published."""

    def __init__(self, graph, **parameters):
        self.graph, self.filters = graph, []
        self.node = graph.add(
            lambda **options: ParticleFilterNode(load=loader_of(self.filters), **options),
            {**REPLAY, **parameters},
        )
        self.statuses = graph.listen(FilterStatus, "filter_status", latched=True)
        self.codes = graph.publisher(TactileCode, "tactile/code")
        self.tf = graph.publisher(TFMessage, "/tf")
        graph.spin_until(lambda: self.statuses, "the status at start")
        self.statuses.clear()

    @property
    def filter(self):
        return self.filters[-1]

    def answered(self) -> list[int]:
        return [stamp_ns(status.header.stamp) for status in self.statuses]

    def frame(self, stamp: int, T_base_gel: np.ndarray, **code) -> FilterStatus:
        """Send transform and code of one frame; the status that answers it."""
        before = len(self.statuses)
        self.tf.publish(tf_msg(stamp, T_base_gel))
        self.codes.publish(code_msg(stamp, **code))
        self.graph.spin_until(lambda: stamp in self.answered()[before:], f"the answer to {stamp}")
        return self.statuses[-1]


def test_every_code_is_answered_with_its_stamp_and_the_whole_estimate(graph):
    bench = Bench(graph, **OBJECT)
    poses = graph.listen(PoseWithCovarianceStamped, "pose", latched=True)
    modes = graph.listen(PoseModes, "pose_modes")
    status = bench.frame(SECOND, T_BASE_OBJ)
    assert (status.state, status.header.frame_id, status.n_particles) == ("ambiguous", "object", 800)
    assert dict(zip(status.skipped_names, status.skipped_counts, strict=True))["at_rest"] == 3
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


def test_codes_wait_for_their_transform_in_order(graph):
    bench = Bench(graph, **OBJECT)
    for stamp in (1, 2, 3):
        bench.codes.publish(code_msg(stamp * SECOND))
    graph.spin_for(0.2)
    assert bench.statuses == []
    for stamp in (1, 2, 3):
        bench.tf.publish(tf_msg(stamp * SECOND, translation(0.01 * stamp)))
    graph.spin_until(lambda: len(bench.statuses) == 3)
    assert bench.answered() == [SECOND, 2 * SECOND, 3 * SECOND]
    np.testing.assert_allclose(bench.filter.odometry[2], translation(0.01), atol=1e-9)


def test_transforms_are_interpolated_at_the_stamp_of_the_image(graph):
    bench = Bench(graph, **OBJECT)
    for stamp, x in ((1, 0.0), (2, 0.1), (3, 0.2)):
        bench.tf.publish(tf_msg(stamp * SECOND, translation(x)))
    for stamp in (1.25, 2.5):
        bench.codes.publish(code_msg(round(stamp * SECOND)))
    graph.spin_until(lambda: len(bench.statuses) == 2)
    np.testing.assert_allclose(bench.filter.odometry[1], translation(0.125), atol=1e-9)


def test_transform_that_never_comes_is_stale_with_a_reason(graph):
    bench = Bench(graph, **OBJECT, transform_timeout=0.2)
    bench.codes.publish(code_msg(SECOND))
    graph.spin_until(lambda: bench.statuses)
    assert bench.answered() == [SECOND]
    assert bench.statuses[0].state == "stale"
    assert "digit_gel_frame" in bench.statuses[0].reason
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous", "it recovers"


def test_image_older_than_all_transforms_is_given_up_at_once(graph):
    bench = Bench(graph, **OBJECT, transform_timeout=600.0)
    for stamp in (10, 11):
        bench.tf.publish(tf_msg(stamp * SECOND, T_BASE_OBJ))
    # an answer shows that the transforms are there
    bench.codes.publish(code_msg(round(9.9 * SECOND)))
    graph.spin_until(lambda: bench.statuses)
    assert bench.statuses[0].state == "stale"
    assert "history starts" in bench.statuses[0].reason
    bench.codes.publish(code_msg(11 * SECOND))
    graph.spin_until(lambda: len(bench.statuses) == 2)
    assert bench.statuses[1].state == "ambiguous"


def test_silence_is_stale_once(graph):
    bench = Bench(graph, **{**OBJECT, "input_timeout": 0.2})
    bench.frame(SECOND, T_BASE_OBJ)
    before = time.time_ns()
    graph.spin_until(lambda: bench.statuses[-1].state == "stale")
    assert "no tactile/code" in bench.statuses[-1].reason
    assert before < stamp_ns(bench.statuses[-1].header.stamp) < time.time_ns(), "of no image, but of now"
    count = len(bench.statuses)
    graph.spin_for(0.5)
    assert len(bench.statuses) == count
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"


def test_looped_bag_restarts_once_per_loop(graph):
    bench = Bench(graph, **OBJECT)
    for loop in (1, 2, 3):
        for stamp in (100, 101, 102):
            assert bench.frame(stamp * SECOND, translation(0.01 * stamp)).state == "ambiguous"
        assert bench.filter.starts == ["uniform"] * loop
        assert bench.filter.odometry[-3] is None
    status = bench.statuses[-1]
    assert dict(zip(status.skipped_names, status.skipped_counts, strict=True))["time_jumps"] == 2


def test_other_frames_may_have_clocks_of_their_own(graph):
    """A camera that starts its clock again, a robot beside this one: nothing that the filter asks for."""
    bench = Bench(graph, **OBJECT)
    for stamp in (100, 101):
        bench.frame(stamp * SECOND, translation(0.01 * stamp))
    for other in (5000, 3, 4000, 2):
        bench.tf.publish(tf_msg(other * SECOND, translation(0.1), "base_link", "camera"))
        bench.tf.publish(tf_msg(other * SECOND, translation(0.1), "map", "base_link"))
    for stamp in (102, 103):
        assert bench.frame(stamp * SECOND, translation(0.01 * stamp)).state == "ambiguous"
    assert bench.filter.starts == ["uniform"]
    assert len(bench.filter.odometry) == 4
    status = bench.statuses[-1]
    assert dict(zip(status.skipped_names, status.skipped_counts, strict=True))["time_jumps"] == 0


def test_looped_bag_whose_code_overtakes_its_transform(graph):
    bench = Bench(graph, **OBJECT)
    bench.frame(100 * SECOND, translation(1.0))
    bench.codes.publish(code_msg(10 * SECOND))
    graph.spin_until(lambda: len(bench.filter.starts) == 2)
    bench.tf.publish(tf_msg(10 * SECOND, translation(0.1)))
    graph.spin_until(lambda: bench.answered()[-1] == 10 * SECOND)
    assert bench.statuses[-1].state == "ambiguous"
    assert bench.filter.starts == ["uniform"] * 2


def test_repeated_and_late_stamps_are_answered_but_not_counted_twice(graph):
    bench = Bench(graph, **OBJECT)
    bench.frame(10 * SECOND, T_BASE_OBJ)
    for stamp in (10 * SECOND, 10 * SECOND - 100_000_000):
        bench.codes.publish(code_msg(stamp))
    graph.spin_until(lambda: len(bench.statuses) == 3)
    assert len(bench.filter.measurements) == 1
    assert bench.answered()[1:] == [10 * SECOND, 10 * SECOND - 100_000_000]
    status = bench.statuses[-1]
    assert dict(zip(status.skipped_names, status.skipped_counts, strict=True))["out_of_order"] == 2


def test_code_of_another_network_is_refused_with_a_reason(graph):
    bench = Bench(graph, **OBJECT)
    status = bench.frame(SECOND, T_BASE_OBJ, network_id="other")
    assert status.state == "stale"
    assert "network other" in status.reason
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"


def test_nothing_that_is_not_finite_is_published(graph):
    bench = Bench(graph, **OBJECT)
    poses = graph.listen(PoseWithCovarianceStamped, "pose", latched=True)
    modes = graph.listen(PoseModes, "pose_modes")
    bench.filter.spoil = True
    status = bench.frame(SECOND, T_BASE_OBJ)
    assert status.state == "lost"
    assert "not finite" in status.reason
    bench.filter.spoil = False
    bench.frame(2 * SECOND, T_BASE_OBJ)
    graph.spin_until(lambda: poses and modes)
    assert [stamp_ns(m.header.stamp) for m in poses + modes] == [2 * SECOND] * 2


def test_object_frame_is_broadcast_only_while_converged(graph):
    bench = Bench(graph, **OBJECT, transform_tolerance=0.5)
    sent = graph.listen(TFMessage, "/tf")

    def of_object():
        return [t for m in sent for t in m.transforms if t.child_frame_id == "object"]

    bench.frame(SECOND, T_BASE_OBJ)
    bench.filter.state = CONVERGED
    bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.02))
    graph.spin_until(of_object)
    (transform,) = of_object()
    assert (transform.header.frame_id, stamp_ns(transform.header.stamp)) == ("base_link", 5 * SECOND // 2)
    np.testing.assert_allclose(transform_from_msg(transform.transform), T_BASE_OBJ, atol=1e-9)


def test_what_is_only_looked_at_is_built_for_somebody(graph):
    bench = Bench(graph, **OBJECT)
    status = bench.frame(SECOND, T_BASE_OBJ)
    counts = dict(zip(status.skipped_names, status.skipped_counts, strict=True))
    status = bench.frame(2 * SECOND, T_BASE_OBJ)
    assert dict(zip(status.skipped_names, status.skipped_counts, strict=True))["no_subscriber"] == (
        counts["no_subscriber"] + 1
    )
    particles = graph.listen(PoseArray, "particles")
    clouds = graph.listen(PointCloud2, "particles/cloud")
    hypotheses = graph.listen(MarkerArray, "hypotheses")
    bench.frame(3 * SECOND, T_BASE_OBJ)
    graph.spin_until(lambda: particles and clouds and hypotheses)
    assert (len(particles[0].poses), clouds[0].width) == (1000, 2000)
    assert {m.header.frame_id for m in [particles[0], clouds[0], *hypotheses[0].markers]} == {"object"}


def test_who_comes_late_sees_object_state_and_pose_at_once(graph):
    """RViz started while the arm rests: nothing is published again."""
    bench = Bench(graph, **OBJECT)
    for stamp in (1, 2):
        bench.frame(stamp * SECOND, translation(0.01 * stamp))
    late = {
        topic: graph.listen(kind, topic, latched=True)
        for kind, topic in (
            (MarkerArray, "object_mesh"),
            (FilterStatus, "filter_status"),
            (PoseWithCovarianceStamped, "pose"),
        )
    }
    for topic in ("filter_status", "pose"):
        last = lambda topic=topic: late[topic] and stamp_ns(late[topic][-1].header.stamp)  # noqa: E731
        graph.spin_until(lambda last=last: last() == 2 * SECOND, f"the last {topic}")
    graph.spin_until(lambda: late["object_mesh"], "the object")
    assert late["object_mesh"][0].markers[-1].mesh_resource == "file:///data/mug.ply"


def test_views_are_limited_in_rate(graph):
    bench = Bench(graph, **{**OBJECT, "view_rate": 0.01})
    particles = graph.listen(PoseArray, "particles")
    for stamp in range(1, 6):
        bench.frame(stamp * SECOND, T_BASE_OBJ)
    graph.spin_until(lambda: particles)
    assert len(particles) == 1


# --- reliefs


def penetration(depth: float) -> np.ndarray:
    out = np.zeros((160, 120), np.float32)
    out[60:80, 40:60] = depth
    return out


def test_each_code_gets_the_relief_of_its_own_cloud(graph, monkeypatch):
    monkeypatch.setattr(relief_source, "_PATIENCE", 30.0)
    bench = Bench(graph, **OBJECT)
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
        np.testing.assert_allclose(measurement.relief, reduced_relief(penetration(depth)), atol=1e-7)


def test_clouds_wait_with_codes_whose_transforms_are_late(graph):
    bench = Bench(graph, **OBJECT)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    stamps = [SECOND + 16_000_000 * k for k in range(30)]
    for stamp in stamps:
        clouds.publish(cloud_msg(stamp, penetration(1e-3)))
        bench.codes.publish(code_msg(stamp))
    for stamp in (stamps[0], stamps[-1]):
        bench.tf.publish(tf_msg(stamp, T_BASE_OBJ))
    graph.spin_until(lambda: len(bench.statuses) == len(stamps))
    assert all(measurement.relief is not None for measurement in bench.filter.measurements)


def test_a_lost_or_broken_cloud_costs_the_relief_only(graph):
    bench = Bench(graph, **OBJECT)
    clouds = graph.publisher(PointCloud2, "tactile/points")
    clouds.publish(cloud_msg(1 * SECOND, penetration(1e-3)))
    broken = cloud_msg(3 * SECOND, penetration(1e-3))
    broken.point_step = 0
    clouds.publish(broken)
    for stamp in (1, 2, 3, 4):
        bench.frame(stamp * SECOND, T_BASE_OBJ, in_contact=stamp != 4)
    reliefs = [measurement.relief is not None for measurement in bench.filter.measurements]
    assert reliefs == [True, False, False, False]
    status = bench.statuses[-1]
    assert dict(zip(status.skipped_names, status.skipped_counts, strict=True))["no_relief"] == 2
    assert bench.node.diagnostics.counts["bad_clouds"] == 1


def test_without_refinement_no_clouds_are_taken(graph):
    graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), {**OBJECT, "refinement": False})
    assert graph.companion.count_subscribers("tactile/points") == 0


# --- starts


def test_without_an_object_it_says_so_until_one_is_set(graph, tmp_path):
    bench = Bench(graph)
    status = bench.frame(SECOND, T_BASE_OBJ)
    assert status.state == "uninitialised"
    assert "set_object" in status.reason
    meshes = graph.listen(MarkerArray, "object_mesh", latched=True)
    refused = graph.call(SetObject, "set_object", SetObject.Request(mesh_path="/bad.ply", codebook_path="/a.npz"))
    assert (refused.success, refused.message) == (False, "/bad.ply: not a mesh")
    request = SetObject.Request(mesh_path="/data/mug.ply", codebook_path="/data/mug.npz")
    assert graph.call(SetObject, "set_object", request).success
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"
    graph.spin_until(lambda: meshes)
    assert [m.action for m in meshes[0].markers] == [Marker.DELETEALL, Marker.ADD]
    assert meshes[0].markers[1].mesh_resource == "file:///data/mug.ply"


def test_init_mode_wait_and_initialpose(graph):
    bench = Bench(graph, **OBJECT, init_mode="wait")
    starts = graph.publisher(PoseWithCovarianceStamped, "initialpose")
    assert bench.frame(SECOND, T_BASE_OBJ).state == "uninitialised"
    given = se3.make(se3.random_rotations(1, np.random.default_rng(0))[0], np.array([0.01, 0.02, 0.03]))
    # as RViz sends it: no information in z, roll, pitch
    starts.publish(pose_msg("object", given, (0.25, 0.25, 0, 0, 0, (math.pi / 12) ** 2)))
    graph.spin_until(lambda: bench.filter.starts)
    pose, sigma_t, sigma_r = bench.filter.starts[0]
    np.testing.assert_allclose(pose, given, atol=1e-9)
    assert (sigma_t, sigma_r) == pytest.approx((DIAGONAL / 3, math.radians(60)))
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"


def test_initialpose_in_another_frame_needs_to_know_where_the_object_is(graph):
    bench = Bench(graph, **OBJECT)
    starts = graph.publisher(PoseWithCovarianceStamped, "initialpose")
    bench.frame(SECOND, T_BASE_OBJ)
    in_base = pose_msg("base_link", T_BASE_OBJ @ translation(0.05))
    starts.publish(in_base)
    graph.spin_until(lambda: bench.node.diagnostics.counts.get("bad_initialpose") == 1)
    assert bench.filter.starts == ["uniform"]
    bench.filter.state = CONVERGED
    bench.frame(2 * SECOND, T_BASE_OBJ)
    starts.publish(in_base)
    graph.spin_until(lambda: len(bench.filter.starts) == 2)
    np.testing.assert_allclose(bench.filter.starts[1][0], translation(0.05), atol=1e-9)


def test_unusable_poses_are_refused(graph):
    bench = Bench(graph, **OBJECT)
    starts = graph.publisher(PoseWithCovarianceStamped, "initialpose")
    not_finite = pose_msg("object", np.eye(4))
    not_finite.pose.pose.position.x = math.nan
    no_rotation = pose_msg("object", np.eye(4))
    no_rotation.pose.pose.orientation.w = 0.0
    negative = pose_msg("object", np.eye(4), (-1.0,) + (1.0,) * 5)
    for msg in (not_finite, no_rotation, negative):
        starts.publish(msg)
    graph.spin_until(lambda: bench.node.diagnostics.counts.get("bad_initialpose") == 3)
    assert bench.filter.starts == ["uniform"]


def test_object_pose_prior_starts_at_the_next_frame(graph):
    bench = Bench(graph, **OBJECT, init_mode="wait")
    priors = graph.publisher(PoseWithCovarianceStamped, "object_pose_prior")
    bench.tf.publish(tf_msg(SECOND, translation(0, 0, 1), "base_link", "camera"))
    camera_is_known = bench.node._transforms.lookup
    graph.spin_until(lambda: not isinstance(camera_is_known("base_link", "camera", None), Wait))
    T_camera_obj = se3.inverse(translation(0, 0, 1)) @ T_BASE_OBJ
    priors.publish(pose_msg("camera", T_camera_obj))
    graph.spin_until(lambda: bench.node._localiser._pending_prior is not None)
    assert bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.03)).state == "ambiguous"
    np.testing.assert_allclose(bench.filter.starts[0][0], translation(0.03), atol=1e-9)


def test_init_mode_pose(graph):
    parameters = {"init_mode": "pose", "initial_pose.x": 0.02, "initial_pose.yaw": math.pi / 2}
    bench = Bench(graph, **OBJECT, **parameters)
    pose, sigma_t, sigma_r = bench.filter.starts[0]
    expected = [[0, -1, 0, 0.02], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(pose, expected, atol=1e-12)
    assert (sigma_t, sigma_r) == (0.02, 0.35)


def test_services_of_nav2(graph):
    bench = Bench(graph, **OBJECT, init_mode="pose")
    bench.frame(SECOND, T_BASE_OBJ)
    graph.call(Empty, "reinitialize_global_localization", Empty.Request())
    assert bench.filter.starts[-1] == "uniform"
    graph.call(Empty, "request_nomotion_update", Empty.Request())
    assert bench.filter.forced == 1


# --- parameters


@pytest.mark.parametrize(
    ("parameters", "complaint"),
    [
        ({"max_partcles": 10}, "no parameter 'max_partcles'"),
        ({"init_mode": "somewhere"}, "one of uniform, pose, wait"),
        ({"min_particles": 0}, "min_particles"),
        ({"min_particles": 5000, "max_particles": 1000}, "min_particles"),
        ({"mesh": "/data/mug.ply"}, "codebook"),
        ({"mesh": "/bad.ply", "codebook": "/a.npz"}, "not a mesh"),
    ],
)
def test_bad_parameters_fail_at_start(graph, parameters, complaint):
    with pytest.raises(InputError, match=complaint):
        graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), parameters)


def test_code_handed_over_in_one_process(graph):
    bench_filters = []
    node = graph.add(
        lambda **options: ParticleFilterNode(load=loader_of(bench_filters), subscribe=False, **options),
        {**REPLAY, **OBJECT},
    )
    statuses = graph.listen(FilterStatus, "filter_status", latched=True)
    tf = graph.publisher(TFMessage, "/tf")
    tf.publish(tf_msg(SECOND, T_BASE_OBJ))
    node.on_code(SECOND, Measurement(False, None, 0.0, "fake"))
    graph.spin_until(lambda: any(stamp_ns(s.header.stamp) == SECOND for s in statuses))
    assert not bench_filters[0].measurements[0].in_contact


def test_paused_simulated_time_does_not_run_out(graph):
    bench = Bench(graph, **OBJECT, use_sim_time=True, transform_timeout=0.2)
    clock = graph.publisher(Clock, "/clock")

    def tick(seconds: float):
        now = round(seconds * SECOND)
        clock.publish(Clock(clock=code_msg(now).header.stamp))
        graph.spin_until(lambda: bench.node.get_clock().now().nanoseconds == now)

    tick(10.0)
    bench.codes.publish(code_msg(10 * SECOND))
    graph.spin_for(0.6)
    assert bench.statuses == []
    tick(10.5)
    graph.spin_until(lambda: bench.statuses)
    assert bench.statuses[0].state == "stale"
