"""Parameter files of several nodes: laid over each other, changed, and moved into a namespace."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import yaml

from midastouch_common.errors import InputError
from midastouch_common.files import read_yaml

EVERY_NODE = "**"
"""Name in a parameter file (`/**`) under which parameters of every node stand."""


def read_parameters(path: str | os.PathLike) -> dict[str, dict]:
    """Read the parameters in a ROS parameter file.

    Parameters
    ----------
    path
        The YAML file.

    Returns
    -------
    dict
        Parameters by node name (of `/**/NODE`, NODE in any namespace); names of nested ones are joined by dots.

    Raises
    ------
    InputError
        The file is missing, not YAML, or not of the form NODE: ros__parameters: {...}.
    """
    document = read_yaml(path, "parameter")
    if not isinstance(document, dict):
        raise InputError(f"{path}: holds no nodes; write NODE: {{ros__parameters: {{NAME: VALUE}}}}")
    nodes: dict[str, dict] = {}
    for node, content in document.items():
        values = content.get("ros__parameters") if isinstance(content, dict) else None
        if not isinstance(values, dict) or len(content) != 1:
            raise InputError(f"{path}: node '{node}' must hold ros__parameters and nothing else")
        nodes.setdefault(str(node).removeprefix("/**/").lstrip("/"), {}).update(_flat(values))
    return nodes


def of_node(nodes: Mapping[str, Mapping], name: str) -> dict:
    """Return the parameters of the node `name`, in any namespace, over those of every node.

    Raises InputError if there are none, or if several nodes have that name.
    """
    ours = [node for node in nodes if node.rpartition("/")[2] == name]
    if len(ours) > 1:
        raise InputError(f"parameters of {' and of '.join(ours)}: which of them? Leave one")
    if not ours and EVERY_NODE not in nodes:
        raise InputError(f"no parameters of {name}; there are those of {', '.join(nodes)}")
    return {**nodes.get(EVERY_NODE, {}), **(nodes[ours[0]] if ours else {})}


def merged(layers: Sequence[Mapping[str, Mapping]]) -> dict[str, dict]:
    """Merge parameters by node, later layers over earlier ones."""
    result: dict[str, dict] = {}
    for layer in layers:
        for node, values in layer.items():
            result.setdefault(node, {}).update(values)
    return result


def written(nodes: Mapping[str, Mapping], namespace: str) -> str:
    """Return the text of the parameter file of nodes in `namespace`: keys are full names, as rclpy requires."""
    prefix = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
    content = {prefix + node: {"ros__parameters": dict(values)} for node, values in nodes.items()}
    return yaml.dump(content, Dumper=_Dumper)


class _Dumper(yaml.SafeDumper):
    """Dumper that quotes all text: rcl reads some plain text of PyYAML as a number (20123E45) or a boolean (y).

    A list that several nodes have is written in full for each: rcl reads no aliases.
    """

    def ignore_aliases(self, data: object) -> bool:
        """Return True, for all data."""
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
