"""The parameter files against what the nodes declare."""

from pathlib import Path

import pytest
from rclpy.node import Node

from midastouch_bringup.parameter_files import merged, read_parameters
from midastouch_filter.core.presets import PRESETS
from midastouch_tools.ros.parameter_tables import TABLES

CONFIG = Path(__file__).parents[1] / "config"


def declared(node):
    """Default values by name, from the node's own table."""
    return {one.name: one.default for one in TABLES[node]}


@pytest.mark.parametrize("name", sorted(path.name for path in CONFIG.glob("*.yaml") if path.name != "frames.yaml"))
def test_keys_are_parameters_that_accept_their_values(name):
    """Also their types: rclpy refuses 1 where it declared 1.0."""
    for node, values in read_parameters(CONFIG / name).items():
        table = {one.name: one for one in TABLES[node]}
        assert set(values) <= set(table), node
        for parameter, value in values.items():
            assert table[parameter].problem(value) is None, f"{node}: {parameter}"


def test_the_live_file_holds_defaults():
    nodes = read_parameters(CONFIG / "midastouch.yaml")
    elsewhere = {"calibrate", "replay", "recorder", "view", "mount_tf", "detection_prior", "explorer"} | {
        "simulated_finger",
        "simulated_gripper",
        "contact_controller",
        "mujoco_arm",
        "ur_speed",
    }
    assert set(nodes) == set(TABLES) - elsewhere
    for node, values in nodes.items():
        for parameter, value in values.items():
            assert value == declared(node)[parameter], f"{node}: {parameter}"


@pytest.mark.parametrize("name", ["replay.yaml", "explore_finger.yaml"])
def test_an_overlay_changes_something_and_drops_nothing(name):
    live, overlay = read_parameters(CONFIG / "midastouch.yaml"), read_parameters(CONFIG / name)
    for node, values in overlay.items():
        defaults = declared(node)
        assert all(defaults[parameter] != value for parameter, value in values.items()), node
    both = merged([live, overlay])
    for node in ("tdn", "tcn", "particle_filter"):
        assert both[node]["reliable"]
        assert both[node]["queue_depth"] > 1


@pytest.mark.parametrize("node", TABLES)
def test_parameters_are_described_and_accept_their_defaults(node):
    for one in TABLES[node]:
        assert len(one.description) > 3, one.name
        assert one.problem(one.default) is None, one.name


@pytest.mark.parametrize("name", ["midastouch.yaml", "replay.yaml", "explore_finger.yaml"])
def test_presets_have_an_effect(name):
    """What a file sets goes over them."""
    turned = {parameter for settings in PRESETS.values() for parameter in settings}
    assert turned.isdisjoint(read_parameters(CONFIG / name)["particle_filter"])


def test_finger_and_simulated_camera_have_one_time():
    assert read_parameters(CONFIG / "explore_finger.yaml")["digit_sim"]["fps"] == declared("simulated_finger")["fps"]


@pytest.mark.dds
@pytest.mark.parametrize("namespace", ["/", "/left", "/arm/left"])
def test_a_node_of_any_namespace_reads_the_shipped_file(graph, namespace):
    arguments = ["--ros-args", "--params-file", str(CONFIG / "replay.yaml")]
    options = {"namespace": namespace, "cli_args": arguments, "automatically_declare_parameters_from_overrides": True}
    node = graph.add(lambda **more: Node("tdn", **options, **more))
    assert node.get_parameter("queue_depth").value == 100
