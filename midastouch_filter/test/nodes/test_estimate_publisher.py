"""What the node publishes of an estimate, for whom and how often."""

from __future__ import annotations

import numpy as np
import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench, skipped
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage
from tf_messages import translation
from visualization_msgs.msg import MarkerArray

from midastouch_common.message_arrays import SECOND, stamp_ns, transform_from_msg
from midastouch_filter.core.state import CONVERGED
from midastouch_msgs.msg import FilterStatus, PoseModes
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.symmetry.search import ObjectSymmetry

pytestmark = pytest.mark.dds

Z = np.array([0.0, 0.0, 1.0])
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def test_nothing_that_is_not_finite_is_published(graph):
    bench = Bench(graph, **OBJECT)
    poses = graph.listen(PoseWithCovarianceStamped, "pose", latched=True)
    modes = graph.listen(PoseModes, "pose_modes")
    bench.filter.spoil = True
    status = bench.frame(SECOND, T_BASE_OBJ)
    assert status.state == "lost"
    assert "reinitialize_global_localization" in status.reason
    bench.filter.spoil, bench.filter.identity = False, (np.ones(1), 0.25)
    assert bench.frame(2 * SECOND, T_BASE_OBJ).unknown == 0.25
    graph.spin_until(lambda: poses and modes)
    assert [stamp_ns(m.header.stamp) for m in poses + modes] == [2 * SECOND] * 2


@pytest.mark.parametrize(
    ("symmetry", "words", "centre"),
    [
        (Symmetry(), "none; nearly: 1 more", 0.0),
        (Symmetry(np.stack([np.eye(4), HALF_TURN]), centre=0.1 * Z), "2 poses alike (to 0.02 mm)", 0.0),
        (Symmetry(np.stack([np.eye(4), UPSIDE_DOWN]), "axis", Z, 0.1 * Z), "axis, both ends alike (to 0.02 mm)", 0.1),
    ],
    ids=["none", "half turn", "axis"],
)
def test_modes_and_status_say_which_poses_are_alike(graph, symmetry, words, centre):
    bench = Bench(graph, **OBJECT)
    near = Symmetry(np.stack([np.eye(4), HALF_TURN])) if symmetry.trivial else symmetry
    bench.filter.object.symmetry = ObjectSymmetry(symmetry, 2e-5, near)
    modes = graph.listen(PoseModes, "pose_modes")
    assert bench.frame(SECOND, T_BASE_OBJ).symmetry == words
    assert bench.node.describe()[2]["symmetry"] == words
    graph.spin_until(lambda: modes)
    said = modes[0]
    np.testing.assert_allclose([transform_from_msg(each) for each in said.symmetries], symmetry.transforms, atol=1e-9)
    assert said.symmetry_free == symmetry.free
    assert said.symmetry_centre.z == pytest.approx(centre)
    assert said.symmetry_axis.z == pytest.approx(1.0 if symmetry.free == "axis" else 0.0)


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
    counts = skipped(status)
    status = bench.frame(2 * SECOND, T_BASE_OBJ)
    assert skipped(status)["no_subscriber"] == (counts["no_subscriber"] + 1)
    particles = graph.listen(PoseArray, "particles")
    clouds = graph.listen(PointCloud2, "particles/cloud")
    objects = graph.listen(MarkerArray, "hypotheses")
    bench.frame(3 * SECOND, T_BASE_OBJ)
    graph.spin_until(lambda: particles and clouds and objects)
    assert (len(particles[0].poses), clouds[0].width) == (1000, 2000)
    assert {m.header.frame_id for m in [particles[0], clouds[0], *objects[0].markers]} == {"object"}


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
