"""What others ask of the node: its services, and where it starts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench
from filter_fakes import DIAGONAL, pose_msg
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Empty
from tf_messages import tf_msg, translation
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common import se3
from midastouch_common.message_arrays import SECOND
from midastouch_filter.core.state import CONVERGED
from midastouch_msgs.srv import SetObject

pytestmark = pytest.mark.dds


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


def test_services_of_nav2(graph):
    bench = Bench(graph, **OBJECT, init_mode="pose")
    bench.frame(SECOND, T_BASE_OBJ)
    graph.call(Empty, "reinitialize_global_localization", Empty.Request())
    assert bench.filter.starts[-1] == "uniform"
    graph.call(Empty, "request_nomotion_update", Empty.Request())
    assert bench.filter.forced == 1


def test_init_mode_pose(graph):
    parameters = {"init_mode": "pose", "initial_pose": [0.02, 0.0, 0.0, 0.0, 0.0, math.pi / 2]}
    bench = Bench(graph, **OBJECT, **parameters)
    pose, sigma_t, sigma_r = bench.filter.starts[0]
    expected = [[0, -1, 0, 0.02], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(pose, expected, atol=1e-12)
    assert (sigma_t, sigma_r) == (0.02, 0.35)


def test_init_mode_wait_and_initialpose(graph):
    bench = Bench(graph, **OBJECT, init_mode="wait")
    starts = graph.publisher(PoseWithCovarianceStamped, "initialpose")
    assert bench.frame(SECOND, T_BASE_OBJ).state == "uninitialised"
    given = se3.make(se3.random_rotations(1, np.random.default_rng(0))[0], np.array([0.01, 0.02, 0.03]))
    # as RViz sends it: no information in z, roll, pitch
    starts.publish(pose_msg("/object", given, (0.25, 0.25, 0, 0, 0, (math.pi / 12) ** 2)))
    graph.spin_until(lambda: bench.filter.starts)
    pose, sigma_t, sigma_r = bench.filter.starts[0]
    np.testing.assert_allclose(pose, given, atol=1e-9)
    assert (sigma_t, sigma_r) == pytest.approx((DIAGONAL / 3, math.radians(60)))
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"


def test_initialpose_in_another_frame_needs_the_object_s_pose(graph):
    bench = Bench(graph, **OBJECT)
    starts = graph.publisher(PoseWithCovarianceStamped, "initialpose")
    bench.tf.publish(tf_msg(SECOND, translation(0, 0, 1), "base_link", "camera"))
    bench.frame(SECOND, T_BASE_OBJ)  # whose transform came after the camera's
    in_camera = pose_msg("camera", translation(0, 0, -1) @ T_BASE_OBJ @ translation(0.05))
    starts.publish(in_camera)
    graph.spin_until(lambda: bench.node.diagnostics.counts.get("bad_initialpose") == 1)
    assert bench.filter.starts == ["uniform"]
    bench.filter.state = CONVERGED
    bench.frame(2 * SECOND, T_BASE_OBJ)
    starts.publish(in_camera)
    graph.spin_until(lambda: len(bench.filter.starts) == 2)
    np.testing.assert_allclose(bench.filter.starts[1][0], translation(0.05), atol=1e-9)


def test_unusable_poses_are_refused(graph):
    bench = Bench(graph, **OBJECT)
    not_finite = pose_msg("object", np.eye(4))
    not_finite.pose.pose.position.x = math.nan
    no_rotation = pose_msg("object", np.eye(4))
    no_rotation.pose.pose.orientation.w = 0.0
    negative = pose_msg("object", np.eye(4), (-1.0,) + (1.0,) * 5)
    unknown = [pose_msg(frame, np.eye(4)) for frame in ("", "/", "moon")]
    for topic in ("initialpose", "object_pose_prior"):
        publisher = graph.publisher(PoseWithCovarianceStamped, topic)
        for count, msg in enumerate((not_finite, no_rotation, negative, *unknown), start=1):
            publisher.publish(msg)
            counted = lambda kind=f"bad_{topic}": bench.node.diagnostics.counts.get(kind)  # noqa: E731
            graph.spin_until(lambda counted=counted, count=count: counted() == count, f"pose {count} to be refused")
    assert bench.filter.starts == ["uniform"]


def test_object_pose_prior_starts_at_the_next_frame(graph):
    bench = Bench(graph, **OBJECT, init_mode="wait")
    priors = graph.publisher(PoseWithCovarianceStamped, "object_pose_prior")
    bench.tf.publish(tf_msg(SECOND, translation(0, 0, 1), "base_link", "camera"))
    assert bench.frame(SECOND).state == "uninitialised"  # whose transform came after the camera's
    T_camera_obj = se3.inverse(translation(0, 0, 1)) @ T_BASE_OBJ
    for frame in ("/camera", ""):  # the second, which is refused, tells that the first was read
        priors.publish(pose_msg(frame, T_camera_obj))
    graph.spin_until(lambda: bench.node.diagnostics.counts.get("bad_object_pose_prior"), "the priors")
    assert bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.03)).state == "ambiguous"
    np.testing.assert_allclose(bench.filter.starts[0][0], translation(0.03), atol=1e-9)
