"""No module imports itself by way of others, at whatever depth of the code: each can be read, and moved, on its own."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import packages
import pytest

ROOT = Path(__file__).resolve().parent.parent


def import_graph(folders: list[Path]) -> dict[str, set[str]]:
    """What each module of some packages imports of them, by dotted names."""
    files = {_name(path, folder.parent): path for folder in folders for path in sorted(folder.rglob("*.py"))}
    return {name: set(_imports(name, path, files)) - {name} for name, path in files.items()}


def _name(path: Path, top: Path) -> str:
    parts = path.relative_to(top).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(name: str, path: Path, files: dict[str, Path]) -> Iterator[str]:
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in files)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                # a module, or a name in one
                yield from [one for one in (f"{source}.{alias.name}", source) if one in files][:1]


def circle(graph: dict[str, set[str]]) -> list[str]:
    """One circle of a graph, its first module again at the end; empty without any."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1][::-1]
    return []


def test_no_module_imports_itself_by_way_of_others():
    assert circle(import_graph([ROOT / package / package for package in packages.PYTHON])) == []


@pytest.mark.parametrize("line", ["from .b import f", "def late():\n    from . import b", "import pack.b"])
def test_a_circle_is_found(tmp_path, line):
    (tmp_path / "pack").mkdir()
    modules = {"__init__": "", "a": line, "b": "from pack.c import *", "c": "import numpy\nfrom .a import g"}
    for name, text in modules.items():
        (tmp_path / "pack" / f"{name}.py").write_text(text)
    found = circle(import_graph([tmp_path / "pack"]))
    assert len(found) == 4
    assert set(found) == {"pack.a", "pack.b", "pack.c"}
    (tmp_path / "pack" / "c.py").write_text("import numpy")
    assert circle(import_graph([tmp_path / "pack"])) == []
