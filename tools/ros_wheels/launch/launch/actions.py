"""Actions."""

from __future__ import annotations

import os

from . import LaunchDescriptionEntity
from .substitution import Joined, perform


class Action(LaunchDescriptionEntity):
    """An action, executed if its condition holds."""

    def __init__(self, *, condition=None):
        self.condition = condition

    def visit(self, context):
        """Execute it if its condition holds."""
        return self.execute(context) if self.condition is None or self.condition.evaluate(context) else None

    def execute(self, context):
        """Do what it stands for; returns what is to be visited next."""
        raise NotImplementedError


class DeclareLaunchArgument(Action):
    """An argument of the launch file; without a default it must be given."""

    def __init__(self, name, *, default_value=None, description="", choices=None, condition=None):
        super().__init__(condition=condition)
        self.name, self.description, self.choices = name, description, choices
        self.default_value = None if default_value is None else [Joined(default_value)]

    def execute(self, context) -> None:
        """Take the default, unless a value is given. Raises RuntimeError for a value that is none of the choices."""
        given = context.launch_configurations
        if self.name not in given and self.default_value is None:
            raise RuntimeError(f"{self.name}: must be given, {self.name}:=VALUE: {self.description}")
        if self.name not in given:
            given[self.name] = perform(context, self.default_value)
        if self.choices and given[self.name] not in self.choices:
            raise RuntimeError(f"{self.name}:={given[self.name]}: must be one of {', '.join(self.choices)}")


class IncludeLaunchDescription(Action):
    """Another launch file, with the arguments of this one and those given here."""

    def __init__(self, launch_description_source, *, launch_arguments=(), condition=None):
        super().__init__(condition=condition)
        self.launch_description_source, self._arguments = launch_description_source, launch_arguments

    def execute(self, context):
        """Return its description."""
        for name, value in self._arguments:
            context.launch_configurations[name] = perform(context, value)
        return [self.launch_description_source.get_launch_description(context)]


class OpaqueFunction(Action):
    """A function of the context."""

    def __init__(self, *, function, args=(), kwargs=None, condition=None):
        super().__init__(condition=condition)
        self._function, self._args, self._kwargs = function, args, kwargs or {}

    def execute(self, context):
        """Call it."""
        return self._function(context, *self._args, **self._kwargs)


class SetEnvironmentVariable(Action):
    """Sets an environment variable of the processes."""

    def __init__(self, name, value, *, condition=None):
        super().__init__(condition=condition)
        self._name, self._value = name, value

    def execute(self, context) -> None:
        """Set it."""
        os.environ[perform(context, self._name)] = perform(context, self._value)


class Shutdown(Action):
    """Ends the launch."""

    def __init__(self, *, reason="reason not given", condition=None):
        super().__init__(condition=condition)
        self.reason = reason

    def execute(self, context) -> None:
        """Begin to end it."""
        context.is_shutdown = True
