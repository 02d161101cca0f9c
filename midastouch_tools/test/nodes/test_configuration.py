"""The shipped YAML files name parameters that exist, with values that the nodes accept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node

from midastouch_bringup.parameter_files import read_parameters
from midastouch_filter.nodes import filter_parameters
from midastouch_motion.nodes import ur_tf
from midastouch_perception.nodes import tcn, tdn
from midastouch_tools.nodes import replay

CONFIG = Path(__file__).parents[3] / "midastouch_bringup/config"
TABLES = {
    "tdn": tdn.PARAMETERS,
    "tcn": tcn.PARAMETERS,
    "particle_filter": filter_parameters.PARAMETERS,
    "replay": replay.PARAMETERS,
    "ur_tf": ur_tf.PARAMETERS,
}


def settings() -> Iterator[tuple[str, str, str, Any]]:
    """(file, node, parameter, value) of every line that sets one of these nodes' parameters."""
    for path in sorted(CONFIG.glob("*.yaml")):
        if path.name != "frames.yaml":
            for node, values in read_parameters(path).items():
                yield from ((path.name, node, name, value) for name, value in values.items() if node in TABLES)


def test_there_is_something_to_check():
    assert {node for _, node, _, _ in settings()} >= {"tdn", "tcn", "particle_filter"}


@pytest.mark.parametrize(("file", "node", "name", "value"), list(settings()))
def test_parameter_exists_and_accepts_the_value(file, node, name, value):
    table = {parameter.name: parameter for parameter in TABLES[node]}
    assert name in table, f"{file}: {node} has no parameter {name}"
    assert table[name].problem(value) is None
    if file == "midastouch.yaml":
        assert value == table[name].default, "the deployment file shows the defaults"


@pytest.mark.parametrize("node", TABLES)
def test_every_parameter_is_described_and_its_default_is_legal(node):
    for parameter in TABLES[node]:
        assert parameter.description
        assert parameter.problem(parameter.default) is None


@pytest.mark.parametrize("namespace", ["/", "/left", "/arm/left"])
def test_a_node_of_any_namespace_reads_the_shipped_file(graph, namespace):
    arguments = ["--ros-args", "--params-file", str(CONFIG / "replay.yaml")]
    options = {"namespace": namespace, "cli_args": arguments, "automatically_declare_parameters_from_overrides": True}
    node = graph.add(lambda **more: Node("tdn", **options, **more))
    assert node.get_parameter("queue_depth").value == 100
