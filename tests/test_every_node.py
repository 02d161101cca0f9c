"""What holds for every node that users start, and for every parameter of it (see docs/parameters.md)."""

import ast
import inspect
import textwrap

import pytest
from every_node import make_node
from rclpy.node import Node
from rclpy.parameter import Parameter

from midastouch_common.errors import InputError
from midastouch_common.ros.managed_node import AUTOSTART
from midastouch_tools.ros.parameter_tables import TABLES

pytestmark = pytest.mark.dds


def assigned(cls: type) -> set[str]:
    """Attributes of `self` that the methods of a class assign."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and getattr(node.value, "id", "") == "self"
    }


@pytest.fixture(params=TABLES)
def running(request, context, tmp_path):
    """Name of a node, and the node."""
    node = make_node(request.param, context, tmp_path)
    yield request.param, node
    node.destroy_node()


def test_nothing_that_rclpy_keeps_in_a_node_is_overwritten(running, context):
    """`_clock`, for one, is what get_clock() returns."""
    node, plain = running[1], Node("plain", context=context)
    ours = [cls for cls in type(node).__mro__ if cls.__module__.split(".")[0] not in ("rclpy", "builtins", "typing")]
    assert ours
    assert not vars(plain).keys() & set().union(*map(assigned, ours))
    now = plain.get_clock().now()
    assert 0 <= (node.get_clock().now() - now).nanoseconds < 10_000_000_000
    plain.destroy_node()


def illegal_values(parameter) -> list:
    """Values of the right type that the parameter must not take, and one of a wrong type."""
    low, high = getattr(parameter, "limits", None) or (getattr(parameter, k, None) for k in ("minimum", "maximum"))
    default = parameter.default
    values = ["no such choice"] if parameter.choices and isinstance(default, str) else []
    if isinstance(default, int | float) and not isinstance(default, bool):
        kind = type(default)
        values += [kind(low - 1)] if low is not None else []
        values += [kind(high + 1)] if high is not None and high < 2**62 else []
    return [*values, 3 if isinstance(default, str) else "three"]


def test_illegal_changes_are_rejected_with_a_reason(running):
    name, node = running
    for parameter in TABLES[name]:
        before = node.get_parameter(parameter.name).value
        for value in illegal_values(parameter):
            (result,) = node.set_parameters([Parameter(parameter.name, value=value)])
            assert not result.successful, (parameter.name, value)
            assert result.reason, (parameter.name, value)
        assert node.get_parameter(parameter.name).value == before


@pytest.mark.parametrize("name", TABLES)
def test_illegal_values_and_names_stop_the_node_and_are_named(name, context, tmp_path):
    for number, parameter in enumerate(TABLES[name]):
        for value in illegal_values(parameter)[:1]:
            with pytest.raises(InputError, match=parameter.name):
                make_node(name, context, tmp_path / str(number), **{parameter.name: value}).destroy_node()
    misspelt = f"{TABLES[name][0].name}_"
    with pytest.raises(InputError, match=misspelt):
        make_node(name, context, tmp_path, **{misspelt: TABLES[name][0].default}).destroy_node()


MANAGED = [name for name, table in TABLES.items() if AUTOSTART in table]
MORE_TOPICS = {"particle_filter": {"fingers": "/right:right_gel"}}


@pytest.mark.parametrize("name", MANAGED)
def test_a_lifecycle_node_hears_only_while_it_is_active(name, context, tmp_path):
    """Also when it is active again, after a clean-up."""
    node, before = make_node(name, context, tmp_path, autostart=False, **MORE_TOPICS.get(name, {})), set()
    for _ in range(2):
        for transition, state in (
            (node.trigger_configure, "inactive"),
            (node.trigger_activate, "active"),
            (node.trigger_deactivate, "inactive"),
            (node.trigger_cleanup, "unconfigured"),
        ):
            transition()
            assert (node.lifecycle_state, node.failure) == (state, "")
            heard = {subscription.topic_name for subscription in node.subscriptions}
            assert bool(heard) == (state == "active" and name != "digit_driver"), "which hears a camera only"
            assert heard in (set(), before or heard), "the same topics each time"
            before |= heard
    node.destroy_node()
