"""`particle_filter` driven by a lifecycle manager over DDS."""

from __future__ import annotations

import signal

import pytest
from filter_bench import OBJECT, REPLAY, T_BASE_OBJ, Bench, executable
from filter_fakes import loader_of
from std_srvs.srv import Empty
from tf_messages import translation
from visualization_msgs.msg import MarkerArray

from midastouch_common.message_arrays import SECOND
from midastouch_filter.core.touch import Measurement
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus
from midastouch_msgs.srv import SetObject

pytestmark = pytest.mark.dds
WAITING = {**REPLAY, "autostart": False}


def add(graph, filters, **parameters) -> ParticleFilterNode:
    """The node on fake filters, not yet configured."""
    return graph.add(
        lambda **options: ParticleFilterNode(load=loader_of(filters), **options), {**WAITING, **parameters}
    )


def await_reason(graph, statuses: list[FilterStatus], words: str) -> FilterStatus:
    graph.spin_until(lambda: statuses and words in statuses[-1].reason, words)
    return statuses[-1]


def test_the_latched_status_tells_each_step_of_its_life(graph):
    add(graph, [], **OBJECT)
    statuses = graph.listen(FilterStatus, "filter_status", latched=True)
    meshes = graph.listen(MarkerArray, "object_mesh", latched=True)
    assert await_reason(graph, statuses, "not configured").state == "uninitialised"
    assert graph.change_state("particle_filter", "configure")
    await_reason(graph, statuses, "configured, but not active")
    assert "loading the mesh /data/mug.ply and the codebook /data/mug.npz" in [s.reason for s in statuses]
    graph.spin_until(lambda: meshes, "the mesh")
    assert graph.change_state("particle_filter", "activate")
    await_reason(graph, statuses, "waiting for tactile/code")
    assert graph.change_state("particle_filter", "deactivate")
    await_reason(graph, statuses, "deactivated")
    late = graph.listen(FilterStatus, "filter_status", latched=True)
    await_reason(graph, late, "deactivated")


def test_a_bad_mesh_fails_the_transition_until_it_is_fixed(graph):
    filters = []
    add(graph, filters, mesh="/data/bad.ply", codebook="/data/mug.npz")
    statuses = graph.listen(FilterStatus, "filter_status", latched=True)
    assert not graph.change_state("particle_filter", "configure")
    await_reason(graph, statuses, "/data/bad.ply: not a mesh")
    assert all(result.successful for result in graph.set_parameters("particle_filter", mesh="/data/mug.ply"))
    assert graph.change_state("particle_filter", "configure")
    assert graph.change_state("particle_filter", "activate")
    await_reason(graph, statuses, "waiting for tactile/code")
    assert filters[0].starts == ["uniform"]


def test_what_was_measured_before_a_pause_counts_no_more(graph):
    bench = Bench(graph, **OBJECT)
    bench.frame(SECOND)
    bench.delay(2 * SECOND)
    assert graph.change_state("particle_filter", "deactivate")
    for inputs in (bench.codes, bench.tf):
        graph.spin_until(lambda inputs=inputs: inputs.get_subscription_count() == 0, "the subscription's end")
    bench.node.on_code(3 * SECOND, Measurement(False, None, 0.0, "fake"))
    assert graph.change_state("particle_filter", "activate")
    graph.spin_until(lambda: bench.codes.get_subscription_count() == 1, "the subscription to codes")
    graph.spin_until(lambda: bench.tf.get_subscription_count() == 1, "the subscription to transforms")
    bench.frame(SECOND + 1, T_BASE_OBJ @ translation(0.05))
    assert bench.filter.odometry == [None, None]
    assert bench.filter.starts == ["uniform", "uniform"]
    assert not bench.answers(3 * SECOND)


def test_services_say_that_it_is_not_active(graph):
    filters = []
    add(graph, filters, **OBJECT)
    request = SetObject.Request(mesh_path="/data/cup.ply", codebook_path="/data/cup.npz")
    for transition in ("configure", "activate"):
        answer = graph.call(SetObject, "set_object", request)
        assert not answer.success
        assert "ros2 lifecycle set" in answer.message
        for service in ("reinitialize_global_localization", "request_nomotion_update"):
            graph.call(Empty, service, Empty.Request())
        assert graph.change_state("particle_filter", transition)
    assert filters[0].starts == ["uniform"]
    assert graph.call(SetObject, "set_object", request).success
    assert len(filters) == 2


@pytest.mark.slow
def test_the_process_ends_with_the_reason_unless_it_is_managed(graph, tmp_path):
    missing = f"mesh:={tmp_path / 'missing.ply'}", f"codebook:={tmp_path / 'missing.npz'}"
    by_itself = executable(*missing)
    _, errors = by_itself.communicate(timeout=120)
    assert by_itself.returncode == 2
    assert [line for line in errors.splitlines() if "missing.ply" in line] == errors.splitlines()[-1:]

    managed = executable(*missing, "autostart:=false")
    try:
        assert graph.state_of("particle_filter") == "unconfigured"
        assert not graph.change_state("particle_filter", "configure")
        assert graph.state_of("particle_filter") == "unconfigured"
        assert all(result.successful for result in graph.set_parameters("particle_filter", mesh="", codebook=""))
        assert graph.change_state("particle_filter", "configure")
        assert graph.change_state("particle_filter", "activate")
        for transition in ("deactivate", "cleanup", "unconfigured_shutdown"):  # as nav2's manager at its end
            assert graph.change_state("particle_filter", transition)
        assert graph.state_of("particle_filter") == "finalized"
        managed.send_signal(signal.SIGINT)
        _, errors = managed.communicate(timeout=60)
    finally:
        managed.kill()
    assert managed.returncode == 0, errors
    assert "missing.ply: no such mesh file" in errors
