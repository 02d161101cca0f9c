"""The services of the node."""

from __future__ import annotations

import types

import numpy as np
import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench
from filter_fakes import DIAGONAL, SECOND, pose_msg, translation
from std_srvs.srv import Empty
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_filter.nodes.filter_services import StartTopics
from midastouch_filter.transforms import TransformBuffer
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
        known = TransformBuffer()
        known.insert("base_link", "camera", 0, translation(0.1), static=True)
        transforms = types.SimpleNamespace(newest=lambda target, source: known.lookup(target, source, 0))
        frames = {"base_frame_id": "base_link", "object_frame_id": "object"}
        StartTopics(node, frames, localiser, transforms, lambda *bad: self.bad.append(bad))

    def _subscribe(self, _type, topic, callback, _qos):
        self.callbacks[topic] = callback

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
