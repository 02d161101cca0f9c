"""`set_object` over DDS: another mesh and codebook while the node runs, and every way in which that is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from filter_bench import OBJECT, T_BASE_OBJ, Bench
from filter_fakes import FakeFilter, StubGrowth, code_msg
from tf2_msgs.msg import TFMessage
from tf_messages import translation
from visualization_msgs.msg import Marker, MarkerArray

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND
from midastouch_filter.core.state import CONVERGED
from midastouch_filter.loaded_object import LoadedObject
from midastouch_msgs.msg import FilterStatus
from midastouch_msgs.srv import SetObject
from midastouch_perception.sensor_model import SensorModel

pytestmark = pytest.mark.dds


def request(name: str, folder: str = "/data") -> SetObject.Request:
    return SetObject.Request(mesh_path=f"{folder}/{name}.ply", codebook_path=f"{folder}/{name}.npz")


class ObjectBench(Bench):
    """A node whose `load` hands out a fake filter per object; `sensors` are those of their codebooks."""

    def __init__(self, graph, sensors=None, **parameters):
        self.of, self.sensors = {}, sensors or {}
        self.while_loading = lambda: None
        super().__init__(graph, self._load, **{**OBJECT, "transform_timeout": 600.0, **parameters})

    def _load(self, mesh_path, codebook_path, config, seed, paper):
        if mesh_path.stem == "bad":
            raise InputError(f"{mesh_path}: not a mesh")
        if mesh_path.stem == "locked":
            raise PermissionError(13, "locked.ply", str(mesh_path))
        self.while_loading()
        self.of[mesh_path.stem] = FakeFilter()
        return LoadedObject(self.of[mesh_path.stem], 0.1, mesh_path.stem, self.sensors.get(mesh_path.stem))

    def set_object(self, *names) -> SetObject.Response:
        return self.graph.call(SetObject, "set_object", request(*names))


def test_the_new_object_starts_from_scratch_and_says_so_at_once(graph):
    bench = ObjectBench(graph)
    meshes, moving = graph.listen(MarkerArray, "object_mesh", latched=True), graph.listen(TFMessage, "/tf")
    graph.spin_until(lambda: meshes, "the first mesh")
    bench.of["mug"].state = CONVERGED
    assert bench.frame(SECOND).state == "converged"
    answer = bench.set_object("cup")
    assert (answer.success, answer.message) == (True, "")
    graph.spin_until(lambda: bench.waits, "the word that an object is read")
    assert "loading the mesh /data/cup.ply" in bench.waits[-1].reason
    late = graph.listen(FilterStatus, "filter_status", latched=True)
    graph.spin_until(lambda: late and "now 'cup'" in late[-1].reason, "the status for who comes now")
    assert (late[-1].state, late[-1].n_particles) == ("uninitialised", 0)

    moving.clear()
    status = bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01))
    assert status.state == "ambiguous"
    assert len(bench.of["mug"].measurements) == 1
    assert bench.of["cup"].starts == ["uniform"]
    assert bench.of["cup"].odometry == [None]  # motion over the old object does not count
    assert not [t for m in moving for t in m.transforms if t.child_frame_id == "object"]
    graph.spin_until(lambda: len(meshes) == 2, "the new mesh")
    assert [(m.action, m.mesh_resource) for m in meshes[1].markers] == [
        (Marker.DELETEALL, ""),
        (Marker.ADD, "file:///data/cup.ply"),
    ]


@pytest.mark.parametrize(
    ("wanted", "complaint"),
    [
        (SetObject.Request(mesh_path="/data/bad.ply", codebook_path="/data/bad.npz"), "bad.ply"),
        (SetObject.Request(mesh_path="/data/cup.step"), "cup.step"),
        (SetObject.Request(codebook_path="/data/cup.npz"), "mesh"),
        (SetObject.Request(mesh_path="package://no_such_package/a.ply", codebook_path="/a.npz"), "no_such_package"),
        (SetObject.Request(mesh_path="/data/locked.ply", codebook_path="/data/locked.npz"), "locked.ply"),
    ],
)
def test_a_refusal_leaves_the_old_object_running(graph, wanted, complaint):
    bench = ObjectBench(graph)
    meshes = graph.listen(MarkerArray, "object_mesh", latched=True)
    bench.frame(SECOND)
    answer = graph.call(SetObject, "set_object", wanted)
    assert not answer.success
    assert complaint in answer.message
    graph.spin_until(lambda: len(bench.statuses) == 2, "the state of before")
    assert (bench.statuses[1].state, bench.statuses[1].n_particles) == ("ambiguous", 800)
    assert bench.frame(2 * SECOND, T_BASE_OBJ @ translation(0.01)).state == "ambiguous"
    assert len(bench.of["mug"].measurements) == 2
    np.testing.assert_allclose(bench.of["mug"].odometry[1], translation(0.01), atol=1e-9)
    graph.spin_until(lambda: meshes)
    assert len(meshes) == 1


def test_a_codebook_of_another_sensor_is_refused_with_the_fix(graph):
    sensors = {name: SensorModel.load(f"digit_{name}").for_maps for name in ("real", "tacto")}
    bench = ObjectBench(graph, sensors=sensors, sensor_model="digit_real")
    answer = bench.set_object("tacto")
    assert not answer.success
    for part in ("/data/tacto.npz", "--sensor digit_real"):
        assert part in answer.message
    assert bench.set_object("real").success


@pytest.mark.usefixtures("brisk_health")
def test_without_a_codebook_a_coarse_one_is_built_and_reported(graph):
    asked, growth = [], StubGrowth()

    def build(mesh_path, network, sensor_model, config, seed, paper):
        asked.append((mesh_path, network, sensor_model, seed))
        running = FakeFilter()
        running.object.density = "codebook of 5,000 poses, 6.0 mm apart"
        return LoadedObject(running, 0.1, mesh_path.stem, None, "fake", growth=growth)

    bench = ObjectBench(graph, options={"build": build}, tcn="/nets/own.onnx", seed=3, object_folders="/data")
    health = graph.health()
    wanted = SetObject.Request(mesh_path="/data/cup.ply")
    assert graph.call(SetObject, "set_object", wanted).success
    assert asked == [(Path("/data/cup.ply"), "/nets/own.onnx", "digit_tacto", 3)]
    graph.spin_until(lambda: bench.statuses and "now 'cup'" in bench.statuses[-1].reason, "the word that it is there")
    assert "by a coarse codebook of 5,000 poses, 6.0 mm apart" in bench.statuses[-1].reason
    assert "building a codebook of 5,000 poses" in bench.waits[-1].reason
    graph.spin_until(lambda: health.values.get("codebook") == "codebook of 5,000 poses, 6.0 mm apart", "its health")
    assert bench.frame(SECOND).reason.endswith("; codebook of 5,000 poses, 6.0 mm apart; growing")
    growth.done = True
    assert "growing" not in bench.frame(2 * SECOND).reason
    outside = graph.call(SetObject, "set_object", SetObject.Request(mesh_path="/secret/cup.ply"))
    assert "outside of /data" in outside.message
    bench.node.destroy_node()
    assert growth.calls == ["start", "close"]


def test_neither_links_nor_dots_lead_out_of_the_allowed_folders(graph, tmp_path):
    inside, outside = tmp_path / "objects", tmp_path / "secret"
    inside.mkdir()
    outside.mkdir()
    (inside / "link").symlink_to(outside)
    bench = ObjectBench(graph, object_folders=f"/opt/nothing:{inside}")
    for folder in (outside, f"{inside}/../secret", f"{inside}/link", f"file://{outside}"):
        answer = bench.set_object("cup", str(folder))
        assert not answer.success
        assert "outside of /opt/nothing, " in answer.message
    assert set(bench.of) == {"mug"}  # the object of the parameters may lie anywhere
    assert bench.set_object("cup", str(inside)).success
    assert bench.set_object("cup", f"file://{inside}").success


def test_nobody_was_silent_while_an_object_was_read(graph, timeout_clock):
    """That takes seconds, in which this node hears nothing."""
    bench = ObjectBench(graph, fingers="/right:right_gel", input_timeout=100.0)
    bench.frame(SECOND)

    def pass_time() -> None:
        timeout_clock.now += 1000.0

    bench.while_loading = pass_time
    assert bench.set_object("cup").success
    timeout_clock.now += 150.0
    graph.spin_until(lambda: bench.statuses[-1].state == "stale", "the word that nothing comes")
    assert [status.state for status in bench.statuses] == ["ambiguous", "uninitialised", "stale"]
    assert re.search(r"tactile/code .*150.* /diagnostics", bench.statuses[-1].reason)
    assert "silent_fingers" not in bench.node.diagnostics.counts


def test_codes_still_waiting_belong_to_the_old_object(graph):
    bench = ObjectBench(graph)
    bench.frame(SECOND)
    for stamp in (2, 3):
        bench.codes.publish(code_msg(stamp * SECOND))
    graph.spin_until(lambda: bench.waited(3 * SECOND), "the codes in the queue")
    assert bench.set_object("cup").success
    graph.spin_until(lambda: bench.answers(2 * SECOND) and bench.answers(3 * SECOND), "an answer to both")
    assert "the object was changed" in bench.answers(3 * SECOND)[0].reason
    assert bench.answers(3 * SECOND)[0].state == "stale"
    assert bench.frame(4 * SECOND).state == "ambiguous"
    assert len(bench.of["cup"].measurements) == 1
