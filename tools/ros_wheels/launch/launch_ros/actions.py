"""Nodes as actions."""

from __future__ import annotations

from pathlib import Path

import yaml
from launch.actions import Action
from launch.substitution import perform

from .parameter_descriptions import ParameterValue, evaluated
from .substitutions import ExecutableInPackage


class Node(Action):
    """A process with a node."""

    def __init__(
        self,
        *,
        package,
        executable,
        name=None,
        namespace="",
        parameters=(),
        remappings=(),
        arguments=(),
        ros_arguments=(),
        output="log",
        respawn=False,
        respawn_delay=0.0,
        on_exit=None,
        condition=None,
    ):
        super().__init__(condition=condition)
        self.package, self.executable = package, executable
        self.on_exit, self.respawn, self.respawn_delay = on_exit, respawn, respawn_delay
        self._name, self._namespace, self._parameters = name, namespace, parameters
        self._remappings, self._arguments, self._ros_arguments = remappings, arguments, ros_arguments

    def command(self, context, folder: Path) -> list[str]:
        """Return the words of its command. Parameters that are no files are written to one in `folder`."""
        words = [ExecutableInPackage(self.executable, self.package).perform(context)]
        words += [perform(context, word) for word in self._arguments]
        words += ["--ros-args", *(perform(context, word) for word in self._ros_arguments)]
        if self._name is not None:
            words += ["-r", f"__node:={perform(context, self._name)}"]
        namespace = perform(context, self._namespace).strip("/")
        words += ["-r", f"__ns:=/{namespace}"] if namespace else []
        own = f"{namespace}/{self.executable}".lstrip("/").replace("/", "_")  # a program may run twice
        for number, parameters in enumerate(self._parameters):
            if isinstance(parameters, dict):
                values = {name: _value(context, value) for name, value in parameters.items()}
                file = folder / f"{own}_{number}.yaml"
                file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
            else:
                file = Path(perform(context, parameters))
                if not file.is_file():
                    raise RuntimeError(f"{file}: no such parameter file")
            words += ["--params-file", str(file)]
        for topic, other in self._remappings:
            words += ["-r", f"{topic}:={other}"]
        return words

    def execute(self, context) -> None:
        """Start it."""
        context.service.start(self, self.executable, self.command(context, Path(context.service.folder)))


class LifecycleNode(Node):
    """A process with a lifecycle node."""

    def __init__(self, *, name, namespace, **options):
        super().__init__(name=name, namespace=namespace, **options)


def _value(context, value):
    """Return a parameter's value; texts and substitutions are read as YAML, unless a ParameterValue has their type."""
    if isinstance(value, ParameterValue):
        return value.evaluate(context)
    return value if isinstance(value, bool | int | float) else evaluated(perform(context, value))
