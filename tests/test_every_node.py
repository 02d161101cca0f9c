"""What holds for every node that users start."""

import ast
import inspect
import textwrap

import pytest
from every_node import make_node
from rclpy.node import Node

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


@pytest.mark.parametrize("name", TABLES)
def test_nothing_that_rclpy_keeps_in_a_node_is_overwritten(name, context, tmp_path):
    """`_clock`, for one, is what get_clock() returns."""
    plain, node = Node("plain", context=context), make_node(name, context, tmp_path)
    try:
        ours = [
            cls for cls in type(node).__mro__ if cls.__module__.split(".")[0] not in ("rclpy", "builtins", "typing")
        ]
        assert ours
        assert not vars(plain).keys() & set().union(*map(assigned, ours))
        now = plain.get_clock().now()
        assert 0 <= (node.get_clock().now() - now).nanoseconds < 10_000_000_000
    finally:
        node.destroy_node()
        plain.destroy_node()
