"""What users do wrong with parameters, for every parameter of every node (see docs/parameters.md)."""

import pytest
from every_node import make_node
from rclpy.parameter import Parameter

from midastouch_common.errors import InputError
from midastouch_tools.ros.parameter_tables import TABLES

pytestmark = pytest.mark.dds


def illegal_values(parameter) -> list:
    """Values of the right type that the parameter must not take, and one of a wrong type."""
    low, high = getattr(parameter, "limits", None) or (
        getattr(parameter, "minimum", None),
        getattr(parameter, "maximum", None),
    )
    default = parameter.default
    values = ["no such choice"] if parameter.choices and isinstance(default, str) else []
    if isinstance(default, int | float) and not isinstance(default, bool):
        kind = type(default)
        values += [kind(low - 1)] if low is not None else []
        values += [kind(high + 1)] if high is not None and high < 2**62 else []
    return [*values, 3 if isinstance(default, str) else "three"]


@pytest.mark.parametrize("name", TABLES)
def test_illegal_changes_are_rejected_with_a_reason(name, context, tmp_path):
    node = make_node(name, context, tmp_path)
    try:
        for parameter in TABLES[name]:
            before = node.get_parameter(parameter.name).value
            for value in illegal_values(parameter):
                (result,) = node.set_parameters([Parameter(parameter.name, value=value)])
                assert not result.successful, (parameter.name, value)
                assert result.reason, (parameter.name, value)
            assert node.get_parameter(parameter.name).value == before
    finally:
        node.destroy_node()


@pytest.mark.parametrize("name", TABLES)
def test_illegal_values_stop_the_node_and_name_the_parameter(name, context, tmp_path):
    for number, parameter in enumerate(TABLES[name]):
        for value in illegal_values(parameter)[:1]:
            with pytest.raises(InputError, match=parameter.name):
                make_node(name, context, tmp_path / str(number), **{parameter.name: value}).destroy_node()


@pytest.mark.parametrize("name", TABLES)
def test_a_misspelt_name_stops_the_node_at_its_start(name, context, tmp_path):
    misspelt = f"{TABLES[name][0].name}_"
    with pytest.raises(InputError, match=misspelt):
        make_node(name, context, tmp_path, **{misspelt: TABLES[name][0].default}).destroy_node()
