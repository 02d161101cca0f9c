"""A replay sends nothing before every node that its images pass through is active."""

import pytest
from filter_fakes import loader_of
from perception_fakes import FakeDepthStage, FakeTcn
from rcl_interfaces.msg import Log
from replay_rig import replay, stamps

from midastouch_bringup.nodes.all_in_one import make_nodes
from midastouch_bringup.parameter_files import read_parameters
from midastouch_filter.nodes.particle_filter import ParticleFilterNode
from midastouch_msgs.msg import FilterStatus
from midastouch_perception.nodes.tcn import TcnNode
from midastouch_perception.nodes.tdn import TdnNode
from midastouch_tools.ros.launch_file import SHARE

pytestmark = pytest.mark.dds
RECORDING = read_parameters(SHARE / "config" / "replay.yaml")
NODES = ("tdn", "tcn", "particle_filter")
OBJECT = {"mesh": "/data/mug.ply", "codebook": "/data/mug.npz"}


def apart(graph, parameters):
    graph.add(lambda **options: TdnNode(depth=FakeDepthStage(), **options), parameters["tdn"])
    graph.add(lambda **options: TcnNode(tcn=FakeTcn(), **options), parameters["tcn"])
    graph.add(lambda **options: ParticleFilterNode(load=loader_of([]), **options), parameters["particle_filter"])


def together(graph, parameters):
    graph.add_all(
        lambda options: make_nodes(depth=FakeDepthStage(), tcn=FakeTcn(), load=loader_of([]), options=options),
        parameters,
    )


@pytest.mark.parametrize("start", [apart, together])
@pytest.mark.parametrize("order", [NODES, NODES[::-1], ("tcn", "particle_filter", "tdn")])
def test_every_frame_is_answered_whichever_node_is_active_first(graph, simulated_sequence, start, order):
    sequence = simulated_sequence(n=4)
    parameters = {name: {**RECORDING[name], "autostart": False} for name in NODES}
    parameters["tdn"]["background"] = str(sequence.background_path)
    parameters["particle_filter"] |= {**OBJECT, "input_timeout": 1000.0}
    start(graph, parameters)
    statuses = graph.listen(FilterStatus, "filter_status", latched=True)
    node = replay(graph, sequence.path, **{**RECORDING["replay"], "clock": False})
    node.start()
    for name in order:
        for transition in ("configure", "activate"):
            assert not node.player.frames_sent
            assert graph.change_state(name, transition)
            assert graph.state_of(name) == {"configure": "inactive", "activate": "active"}[transition]
    graph.spin_until(node.finished.is_set, "the end of the replay")
    assert (node.player.frames_sent, node.player.frames_lost) == (4, 0)
    graph.spin_until(lambda: set(sequence.stamps_ns.tolist()) <= set(stamps(statuses)), "the answers")


def test_it_names_the_nodes_it_waits_for(graph, simulated_sequence):
    node = replay(graph, simulated_sequence(n=2).path, wait_for_nodes="tdn /left/tcn")
    logs = graph.listen(Log, "/rosout", latched=True)
    node.start()
    expected = "waiting for tdn (not found), /left/tcn (not found)"
    graph.spin_until(lambda: any(log.msg == expected for log in logs), "the log")
