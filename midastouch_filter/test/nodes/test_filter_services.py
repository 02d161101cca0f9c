"""What others ask of the node: its services, and where it starts."""

from __future__ import annotations

import math
import types

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
from midastouch_common.transforms.rigid import TransformError
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.nodes.filter_services import StartTopics
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


class Topics:
    """Both topics on a node that only hands messages on; what they told the localiser, and what they refused."""

    def __init__(self):
        self.callbacks, self.starts, self.priors, self.bad = {}, [], [], []
        log = types.SimpleNamespace(info=lambda _: None)
        node = types.SimpleNamespace(create_subscription=self._subscribe, get_logger=lambda: log)
        localiser = types.SimpleNamespace(
            object=types.SimpleNamespace(diagonal=DIAGONAL),
            T_base_obj=lambda: translation(0.0, 0.2),
            start_at=self.starts.append,
            expect_object_at=lambda *prior: self.priors.append(prior),
        )
        transforms = types.SimpleNamespace(newest=self._newest)
        frames = {"base_frame_id": "base_link", "object_frame_id": "object"}
        StartTopics(node, frames, localiser, transforms, lambda *bad: self.bad.append(bad))

    def _subscribe(self, _type, topic, callback, _qos):
        self.callbacks[topic] = callback

    @staticmethod
    def _newest(target, source):
        if (target, source) != ("base_link", "camera"):
            raise TransformError(f"frame '{source}' is not known")
        return translation(0.1)

    def send(self, topic: str, frame: str) -> None:
        self.callbacks[topic](pose_msg(frame, translation(0.0, 0.3)))


@pytest.fixture
def topics():
    return Topics()


@pytest.mark.parametrize("topic", ["initialpose", "object_pose_prior"])
@pytest.mark.parametrize("frame", ["", "/"])
def test_a_pose_in_no_frame_is_refused(topics, topic, frame):
    topics.send(topic, frame)
    ((kind, reason),) = topics.bad
    assert kind == f"bad_{topic}"
    assert "header.frame_id is empty" in reason
    assert not topics.starts + topics.priors


@pytest.mark.parametrize("frame", ["camera", "/camera"])
def test_poses_in_a_known_frame_are_taken(topics, frame):
    topics.send("initialpose", frame)
    topics.send("object_pose_prior", frame)
    assert not topics.bad
    np.testing.assert_allclose(topics.starts[0].pose, translation(0.1, 0.1))
    np.testing.assert_allclose(topics.priors[0][0], translation(0.1, 0.3))


@pytest.mark.parametrize(("frame", "place"), [("/object", (0.0, 0.3)), ("/base_link", (0.0, 0.1))])
def test_our_own_frames_need_no_transform(topics, frame, place):
    topics.send("initialpose", frame)
    assert not topics.bad
    np.testing.assert_allclose(topics.starts[0].pose, translation(*place))


@pytest.mark.parametrize("topic", ["initialpose", "object_pose_prior"])
def test_a_frame_that_nobody_names_is_refused(topics, topic):
    topics.send(topic, "moon")
    ((kind, reason),) = topics.bad
    assert kind == f"bad_{topic}"
    assert "moon" in reason


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
    starts.publish(pose_msg("object", given, (0.25, 0.25, 0, 0, 0, (math.pi / 12) ** 2)))
    graph.spin_until(lambda: bench.filter.starts)
    pose, sigma_t, sigma_r = bench.filter.starts[0]
    np.testing.assert_allclose(pose, given, atol=1e-9)
    assert (sigma_t, sigma_r) == pytest.approx((DIAGONAL / 3, math.radians(60)))
    assert bench.frame(2 * SECOND, T_BASE_OBJ).state == "ambiguous"


def test_initialpose_in_another_frame_needs_the_object_s_pose(graph):
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
    assert bench.frame(SECOND).state == "uninitialised"  # whose transform came after the camera's
    T_camera_obj = se3.inverse(translation(0, 0, 1)) @ T_BASE_OBJ
    for frame in ("camera", ""):  # the second, which is refused, tells that the first was read
        priors.publish(pose_msg(frame, T_camera_obj))
    graph.spin_until(lambda: bench.node.diagnostics.counts.get("bad_object_pose_prior"), "the priors")
    assert bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.03)).state == "ambiguous"
    np.testing.assert_allclose(bench.filter.starts[0][0], translation(0.03), atol=1e-9)
