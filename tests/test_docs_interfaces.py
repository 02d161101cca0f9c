"""Frames, topics, services of docs/interfaces.md and states of docs/states.md, against messages and running nodes."""

import re

import pytest
import yaml
from documents import ROOT, blocks, section, table
from every_node import make_node
from rclpy.action import get_action_server_names_and_types_by_node

from midastouch_common.frames import BASE_FRAME, GEL_FRAME, TRUTH_FRAME, TRUTH_GEL_FRAME
from midastouch_tools.export.recording import FILTER_STATES
from midastouch_tools.ros.parameter_tables import TABLES

NODES = {row[0].strip("`"): row[1:] for row in table("docs/interfaces.md", "## Topics and services")}

# What rclpy gives every node, and every lifecycle node.
EVERY_NODE = {
    "/parameter_events", "/rosout", "/diagnostics", "describe_parameters", "get_parameter_types",
    "get_parameters", "list_parameters", "set_parameters", "set_parameters_atomically",
    "get_type_description",
    "change_state", "get_state", "get_available_states", "get_available_transitions", "get_transition_graph",
    "transition_event",
}  # fmt: skip


def test_frames_are_those_of_the_mount_and_of_the_nodes():
    mount = yaml.safe_load((ROOT / "midastouch_bringup/config/frames.yaml").read_text())
    of_mount = {entry[end] for entry in mount.values() for end in ("parent", "child")}
    of_nodes = {p.default for table_ in TABLES.values() for p in table_ if p.name.endswith("frame_id")}
    described = {row[0].strip("`") for row in table("docs/interfaces.md", "## Frames")}
    assert described == (of_mount | of_nodes) - {"tool0", ""}
    (tree,) = blocks(section("docs/interfaces.md", "## Frames"))
    for frame in described | {"tool0", BASE_FRAME, GEL_FRAME, TRUTH_FRAME, TRUTH_GEL_FRAME}:
        assert frame in tree, frame


def test_states_are_those_of_the_message_and_of_an_export():
    message = (ROOT / "midastouch_msgs" / "msg" / "FilterStatus.msg").read_text()
    states = set(re.findall(r'STATE_\w+ = "(\w+)"', message)) - {"waiting"}
    assert {row[0].strip("`") for row in table("docs/states.md", "## The seven states")} == states
    (row,) = (row for row in table("docs/exports.md", "## Columns") if row[0] == "`filter_state`")
    assert row[2] == ", ".join(f"{number} {name}" for number, name in enumerate(FILTER_STATES))


def interfaces(node, listed) -> set[tuple[str, str]]:
    """(name as in the table, type) of what a node has of one kind."""
    found = set()
    for name, types in listed:
        name = name.replace(f"/{node.get_name()}/", "~/")
        of_action = "/_action/" in name  # actions are made of topics and services
        if name.removeprefix("~/") not in EVERY_NODE and not of_action:
            short = name if name in ("/tf", "/tf_static", "/clock") else name.removeprefix("/")
            found |= {(short, one.rpartition("/")[2]) for one in types}
    return found


def cell(text: str) -> set[tuple[str, str]]:
    assert set(NODES) == set(TABLES), "every node has a row"
    found = set(re.findall(r"`([\w/~]+)` (\w+)", text))
    assert found or text == "-"
    return found


@pytest.mark.dds
@pytest.mark.parametrize("name", NODES)
def test_topics_and_services_are_those_of_the_running_node(name, context, tmp_path):
    node = make_node(name, context, tmp_path)
    try:
        subscribed, published, served = map(cell, NODES[name])
        graph = node.get_name(), node.get_namespace()
        assert interfaces(node, node.get_publisher_names_and_types_by_node(*graph)) == published
        assert interfaces(node, node.get_subscriber_names_and_types_by_node(*graph)) == subscribed
        actions = interfaces(node, get_action_server_names_and_types_by_node(node, *graph))
        assert interfaces(node, node.get_service_names_and_types_by_node(*graph)) | actions == served
    finally:
        node.destroy_node()
