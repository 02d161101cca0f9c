"""ROS parameters as data: one table per node, from which declarations, checks and documentation are made."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node

from ..errors import InputError

# Parameters of rclpy itself, which a YAML file may set on any node.
_FOREIGN = ("use_sim_time", "start_type_description_service")
_FOREIGN_PREFIX = "qos_overrides."


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node.

    `default` fixes the type (bool, int, float, str or a list of one of them). `minimum` and `maximum` are
    inclusive and hold for every element of a list; `choices` lists the only legal values. A parameter
    with `read_only=False` may change at any time. The others of a managed node may change while it is unconfigured,
    except those with `at_start=True`. `presets` gives, for each of the choices, other defaults to parameters further
    down the table; the YAML file and the command line override them. `former` is an earlier name, under which a YAML
    file or the command line may still set the parameter, with a warning.
    """

    name: str
    default: Any
    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple = ()
    read_only: bool = True
    at_start: bool = False
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    former: str = ""

    def problem(self, value: Any) -> str | None:
        """Return the reason why `value` is illegal, as text; None if it is legal."""
        expected = type(self.default)
        if expected is list and isinstance(value, Collection) and not isinstance(value, str):
            if len(value) != len(self.default):
                return f"parameter '{self.name}' needs {len(self.default)} values, got {len(value)}"
            problems = (self._problem_of(v, type(d)) for v, d in zip(value, self.default, strict=True))
            return next((p for p in problems if p), None)
        return self._problem_of(value, expected)

    def _problem_of(self, value: Any, expected: type[Any]) -> str | None:
        if type(value) is not expected:
            hint = f"; write {float(value)}" if expected is float and type(value) is int else ""
            return f"parameter '{self.name}' must be {expected.__name__}, got {type(value).__name__} {value!r}{hint}"
        if expected is float and not math.isfinite(value):
            return f"parameter '{self.name}' must be finite, got {value}"
        if self.choices and value not in self.choices:
            return f"parameter '{self.name}' must be one of {', '.join(map(str, self.choices))}, got {value!r}"
        if expected in (int, float):
            low = -math.inf if self.minimum is None else self.minimum
            high = math.inf if self.maximum is None else self.maximum
            if not low <= value <= high:
                unit = f" {self.unit}" if self.unit else ""
                return f"parameter '{self.name}' must be in [{low}, {high}]{unit}, got {value}"
        return None

    def descriptor(self, managed: bool = False) -> ParameterDescriptor:
        """Return what `ros2 param describe` shows; `managed` is true for a parameter of a managed node."""
        text = f"{self.description} [{self.unit}]" if self.unit else self.description
        out = ParameterDescriptor(name=self.name, description=text)
        out.read_only = self.read_only and (self.at_start or not managed)
        if self.choices:
            out.additional_constraints = "one of " + ", ".join(map(str, self.choices))
        if self.minimum is None and self.maximum is None:
            return out
        element = self.default[0] if isinstance(self.default, list) else self.default
        if isinstance(element, int):
            lowest = -(2**63) if self.minimum is None else int(self.minimum)
            highest = 2**63 - 1 if self.maximum is None else int(self.maximum)
            out.integer_range = [IntegerRange(from_value=lowest, to_value=highest, step=0)]
        else:
            low = -math.inf if self.minimum is None else float(self.minimum)
            high = math.inf if self.maximum is None else float(self.maximum)
            out.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
        return out


class Parameters:
    """Values of a node's parameters, which it declares from a table: `parameters["queue_depth"]`.

    Raises InputError for a value of the wrong type or out of range, and for a name in the node's YAML file
    or command line that the table does not hold, so that a misspelt name never goes unnoticed.

    unconfigured: returns whether a managed node is in that state. gone: advice for each name that was removed.
    """

    def __init__(
        self,
        node: Node,
        table: Iterable[Parameter],
        unconfigured: Callable[[], bool] | None = None,
        gone: Mapping[str, str] = MappingProxyType({}),
    ):
        self._node, self._unconfigured = node, unconfigured
        self.table = {parameter.name: parameter for parameter in table}
        # rclpy keeps the values of the YAML file and the command line in this attribute only
        overrides = node._parameter_overrides
        self._rename_former(overrides)
        for name in overrides:
            if name in gone:
                raise InputError(f"{node.get_name()}: parameter '{name}' is gone: {gone[name]}")
            if name not in self.table and name not in _FOREIGN and not name.startswith(_FOREIGN_PREFIX):
                raise InputError(f"{node.get_name()}: no parameter '{name}'; known are {', '.join(sorted(self.table))}")
        defaults: dict[str, Any] = {}
        for name, parameter in self.table.items():
            parameter = replace(parameter, default=defaults.get(name, parameter.default))
            value = overrides[name].value if name in overrides else parameter.default
            if problem := parameter.problem(value):
                raise InputError(f"{node.get_name()}: {problem}")
            if parameter.presets:
                defaults |= parameter.presets[value]
            try:
                node.declare_parameter(name, value, parameter.descriptor(unconfigured is not None))
            except ParameterException as error:
                raise InputError(f"{node.get_name()}: {error}") from error
        node.add_on_set_parameters_callback(self._check)

    def _rename_former(self, overrides: dict[str, Any]) -> None:
        """Move overrides under a former name to the present one, each with a warning; InputError if both are set.

        This changes rclpy's own dictionary: an undeclared name that is left there is refused when the node is complete.
        """
        for name, parameter in self.table.items():
            former = parameter.former
            if former not in overrides:
                continue
            renamed = f"parameter '{former}' is now '{name}'"
            if name in overrides:
                raise InputError(f"{self._node.get_name()}: {renamed}, and both are set; set '{name}' only")
            self._node.get_logger().warning(f"{renamed}; rename it in the parameter file or on the command line")
            overrides[name] = overrides.pop(former)

    def __getitem__(self, name: str) -> Any:
        value = self._node.get_parameter(name).value
        return list(value) if isinstance(self.table[name].default, list) else value

    def _check(self, changes: list) -> SetParametersResult:
        for change in changes:
            if change.name in self.table and (problem := self._problem(self.table[change.name], change.value)):
                return SetParametersResult(successful=False, reason=problem)
        return SetParametersResult(successful=True)

    def _problem(self, parameter: Parameter, value: Any) -> str | None:
        # rclpy itself refuses changes of parameters that are read-only in every state
        if parameter.read_only and self._unconfigured is not None and not self._unconfigured():
            return f"parameter '{parameter.name}' is read when the node is configured; clean it up first"
        return parameter.problem(value)


QUEUE = (
    Parameter(
        "queue_depth",
        1,
        "Messages kept while the node is busy; 1 drops all but the newest (live), replay wants more",
        minimum=1,
        maximum=10000,
        at_start=True,
    ),
    Parameter(
        "reliable",
        False,
        "Ask the publisher to repeat lost messages (replay); false takes what comes (live)",
        at_start=True,
    ),
)
"""Parameters of every node with a stream input."""
