"""Parameter files of several nodes: laid over each other, changed, and moved into a namespace."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import yaml

from midastouch_common.errors import InputError
from midastouch_common.files import read_yaml

EVERY_NODE = "**"
"""Name of the node in a parameter file (`/**`) whose parameters are every node's."""


def read_parameters(path: str | os.PathLike) -> dict[str, dict]:
    """Parameters by node name of a ROS parameter file, names of nested ones joined by dots.

    Raises InputError for a file that is missing, not YAML, or not of the form NODE: ros__parameters: {...}.
    """
    document = read_yaml(path, "parameter")
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds no nodes; write NODE: {{ros__parameters: {{NAME: VALUE}}}}")
    nodes = {}
    for node, content in document.items():
        values = content.get("ros__parameters") if isinstance(content, dict) else None
        if not isinstance(values, dict) or len(content) != 1:
            raise InputError(f"{path}: node '{node}' must hold ros__parameters and nothing else")
        nodes[str(node).lstrip("/")] = _flat(values)
    return nodes


def of_node(nodes: Mapping[str, Mapping], name: str) -> dict:
    """Parameters of the node called `name`, in whatever namespace, and those of every node.

    Raises InputError if there are none, or of several of that name.
    """
    ours = [node for node in nodes if node.rpartition("/")[2] == name]
    if len(ours) > 1:
        raise InputError(f"parameters of {' and of '.join(ours)}: which of them? Leave one")
    if not ours and EVERY_NODE not in nodes:
        raise InputError(f"no parameters of {name}; there are those of {', '.join(nodes)}")
    return {**nodes.get(EVERY_NODE, {}), **(nodes[ours[0]] if ours else {})}


def merged(layers: Sequence[Mapping[str, Mapping]]) -> dict[str, dict]:
    """Parameters by node, later layers over earlier ones."""
    result: dict[str, dict] = {}
    for layer in layers:
        for node, values in layer.items():
            result.setdefault(node, {}).update(values)
    return result


def written(nodes: Mapping[str, Mapping], namespace: str) -> str:
    """The parameter file of nodes in `namespace`: keys are full names, as rclpy wants them there."""
    prefix = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
    content = {prefix + node: {"ros__parameters": dict(values)} for node, values in nodes.items()}
    return yaml.dump(content, Dumper=_Dumper)


class _Dumper(yaml.SafeDumper):
    """Quotes all text: of what PyYAML leaves plain, rcl takes some for a number (20123E45) or a boolean (y).

    Writes a list that several nodes have as often as they have it: rcl reads no aliases.
    """

    def ignore_aliases(self, data: object) -> bool:
        """Always."""
        return True


_Dumper.add_representer(str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style="'"))


def _flat(values: Mapping, prefix: str = "") -> dict:
    flat = {}
    for name, value in values.items():
        if isinstance(value, dict):
            flat.update(_flat(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat
