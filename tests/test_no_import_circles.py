"""No module imports itself by way of others, at whatever depth of the code: each can be read, and moved, on its own."""

from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import packages
import pytest


def import_graph(modules: dict[str, Path]) -> dict[str, set[str]]:
    """What each module, by its dotted name, imports of the others."""
    graph: dict[str, set[str]] = {name: set() for name in modules}
    for name, path in modules.items():
        for _, source, names in packages.imports(path):
            wanted = [f"{source}.{one}" for one in names] or [source]  # a module, or a name in one
            graph[name] |= {one if one in graph else source for one in wanted if {one, source} & graph.keys()} - {name}
    return graph


def circle(graph: dict[str, set[str]]) -> list[str]:
    """One circle of a graph, its first module again at the end; empty without any."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1][::-1]
    return []


def test_no_module_imports_itself_by_way_of_others():
    assert circle(import_graph({k: v for one in packages.PYTHON for k, v in packages.modules(one).items()})) == []


@pytest.mark.parametrize("line", ["from .b import f", "def late():\n    from . import b", "import pack.b"])
def test_a_circle_is_found(tmp_path, line):
    (tmp_path / "pack").mkdir()
    texts = {"__init__": "", "a": line, "b": "from pack.c import *", "c": "import numpy\nfrom .a import g"}
    paths = {f"pack.{name}": tmp_path / "pack" / f"{name}.py" for name in texts}
    for path, text in zip(paths.values(), texts.values(), strict=True):
        path.write_text(text)
    found = circle(import_graph(paths))
    assert len(found) == 4
    assert set(found) == {"pack.a", "pack.b", "pack.c"}
    paths["pack.c"].write_text("import numpy")
    assert circle(import_graph(paths)) == []
