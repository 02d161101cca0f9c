"""The services of the node."""

from __future__ import annotations

import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench
from filter_fakes import SECOND
from std_srvs.srv import Empty
from visualization_msgs.msg import Marker, MarkerArray

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
