from __future__ import annotations

from functools import partial

import pytest
from rclpy.node import Node

from midastouch_common.errors import InputError
from midastouch_common.ros.parameters import Parameter, Parameters

pytestmark = pytest.mark.dds

TABLE = (
    Parameter("rate", 10.0, "How often", unit="Hz", minimum=0.0, maximum=100.0, read_only=False),
    Parameter("depth", 1, "How deep", minimum=1, maximum=10),
    Parameter("mode", "fast", "Which way", choices=("fast", "slow"), read_only=False),
    Parameter("axis", [0.0, 0.0, 1.0], "Direction", minimum=-1.0, maximum=1.0),
    Parameter("enabled", True, "Whether"),
)


class _Node(Node):
    def __init__(self, **options):
        super().__init__("parametrised", **options)
        self.parameters = Parameters(self, TABLE)


def test_values_come_from_the_table_or_the_overrides(graph):
    node = graph.add(_Node, {"depth": 7, "axis": [1.0, 0.0, 0.0], "use_sim_time": False})
    assert node.parameters["depth"] == 7
    assert node.parameters["axis"] == [1.0, 0.0, 0.0]
    assert node.parameters["rate"] == 10.0
    assert node.parameters["enabled"] is True


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        ({"dpeth": 3}, "'dpeth'.*depth"),
        ({"depth": 0}, r"'depth'.*\[1, 10\]"),
        ({"rate": 5}, "'rate'.*write 5.0"),
        ({"rate": float("nan")}, "'rate'.*finite"),
        ({"rate": 101.0}, "'rate'.*Hz.*101"),
        ({"mode": "warp"}, "'mode'.*fast, slow"),
        ({"axis": [0.0, 1.0]}, "'axis'.*3 values"),
        ({"axis": 1.0}, "'axis'.*list.*float"),
        ({"axis": [0.0, 1.0, 1.5]}, r"'axis'.*\[-1.0, 1.0\]"),
        ({"enabled": 1}, "'enabled'.*bool"),
    ],
)
def test_illegal_overrides_fail_at_start_with_a_reason(graph, overrides, complaint):
    with pytest.raises(InputError, match=complaint):
        graph.add(_Node, overrides)


PRESETS = {"coarse": {"rate": 2.0, "depth": 2}, "plain": {}}
WITH_PRESETS = (Parameter("preset", "plain", "Defaults", choices=tuple(PRESETS), presets=PRESETS), *TABLE)


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [({}, (10.0, 1)), ({"preset": "coarse"}, (2.0, 2)), ({"preset": "coarse", "depth": 1}, (2.0, 1))],
)
def test_a_preset_is_laid_under_what_is_set(graph, overrides, expected):
    class Preset(Node):
        def __init__(self, **options):
            super().__init__("preset", **options)
            self.parameters = Parameters(self, WITH_PRESETS)

    parameters = graph.add(Preset, overrides).parameters
    assert (parameters["rate"], parameters["depth"]) == expected


RENAMED = (Parameter("depth", 1, "How deep", minimum=1, maximum=10, former="deepness"),)


class _Renamed(Node):
    def __init__(self, **options):
        super().__init__("renamed", **options)
        self.warnings = []
        self.get_logger().warning = self.warnings.append
        self.parameters = Parameters(self, RENAMED)


def test_a_former_name_counts_for_the_present_one_with_a_warning(graph):
    node = graph.add(_Renamed, {"deepness": 7})
    assert node.parameters["depth"] == 7
    (warning,) = node.warnings
    assert "'deepness'" in warning
    assert "'depth'" in warning
    assert graph.add(_Renamed, {"depth": 7}).warnings == []


@pytest.mark.parametrize(
    ("overrides", "complaint"), [({"deepness": 0}, "'depth' must be in"), ({"deepness": 2, "depth": 2}, "'depth' only")]
)
def test_an_illegal_former_name_is_refused_with_the_new_one(graph, overrides, complaint):
    with pytest.raises(InputError, match=complaint):
        graph.add(_Renamed, overrides)


def test_changes_while_running(graph):
    node = graph.add(_Node)

    change = partial(graph.set_parameter, "parametrised")
    assert change("rate", 20.0).successful
    assert node.parameters["rate"] == 20.0
    rejected = change("rate", 200.0)
    assert not rejected.successful
    assert "rate" in rejected.reason
    rejected = change("mode", "warp")
    assert not rejected.successful
    assert "fast, slow" in rejected.reason
    assert not change("depth", 2).successful, "read-only"
    assert (node.parameters["rate"], node.parameters["mode"], node.parameters["depth"]) == (20.0, "fast", 1)


def test_descriptor_tells_description_unit_and_range():
    descriptor = TABLE[0].descriptor()
    assert descriptor.description == "How often [Hz]"
    assert (descriptor.floating_point_range[0].from_value, descriptor.floating_point_range[0].to_value) == (0, 100)
    assert TABLE[1].descriptor().integer_range[0].to_value == 10
    assert TABLE[1].descriptor().read_only
    assert "fast" in TABLE[2].descriptor().additional_constraints
