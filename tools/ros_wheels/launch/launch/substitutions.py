"""Substitutions."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

from .substitution import Substitution, perform


class LaunchConfiguration(Substitution):
    """Value of a launch argument."""

    def __init__(self, variable_name, *, default=None):
        self._name, self._default = variable_name, default

    def perform(self, context) -> str:
        """Return it. Raises RuntimeError if there is neither a value nor a default."""
        if self._name in context.launch_configurations:
            return context.launch_configurations[self._name]
        if self._default is None:
            raise RuntimeError(f"launch configuration '{self._name}' does not exist")
        return perform(context, self._default)


class EnvironmentVariable(Substitution):
    """Value of an environment variable."""

    def __init__(self, name, *, default_value=None):
        self._name, self._default = name, default_value

    def perform(self, context) -> str:
        """Return it. Raises RuntimeError if there is neither a value nor a default."""
        found = os.environ.get(self._name, self._default)
        if found is None:
            raise RuntimeError(f"environment variable '{self._name}' does not exist")
        return perform(context, found)


class EqualsSubstitution(Substitution):
    """`true` if two texts are equal, otherwise `false`."""

    def __init__(self, left, right):
        self._sides = left, right

    def perform(self, context) -> str:
        """Compare them."""
        left, right = (perform(context, side) for side in self._sides)
        return str(left == right).lower()


class PathJoinSubstitution(Substitution):
    """Parts of a path, joined."""

    def __init__(self, substitutions):
        self._parts = substitutions

    def perform(self, context) -> str:
        """Join them."""
        return str(Path(*(perform(context, part) for part in self._parts)))


class Command(Substitution):
    """Output of a command."""

    def __init__(self, command, *, on_stderr="fail"):
        self._command = command

    def perform(self, context) -> str:
        """Run it. Raises RuntimeError if it fails."""
        words = shlex.split(perform(context, self._command))
        try:
            return subprocess.run(words, capture_output=True, text=True, check=True).stdout
        except (OSError, subprocess.CalledProcessError) as error:
            raise RuntimeError(f"executed command failed. Command: {shlex.join(words)}: {error}") from error
