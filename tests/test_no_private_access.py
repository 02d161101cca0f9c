"""Tests ask the code what it offers to everybody: no name with a leading underscore, but for an object's own."""

from __future__ import annotations

import ast
import contextlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TESTS = {*ROOT.glob("conftest.py"), *ROOT.glob("tests/**/*.py"), *ROOT.glob("*/test/**/*.py")} - {
    Path(__file__).resolve()
}
PATCHES = {"setattr", "delattr", "getattr", "hasattr"}
ALLOWED = {"pickle._Pickler"}  # the only one of Python's picklers in which `save` can be replaced


def is_private(name: str) -> bool:
    return any(part.startswith("_") and not part.startswith("__") for part in name.split("."))


def private_names(tree: ast.AST) -> Iterator[str]:
    """What a program takes from others by a private name: attributes, imports, what it patches, and code in strings."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            if is_private(node.attr) and not own:
                yield ast.unparse(node)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            module = (getattr(node, "module", None) or "",)
            names = [".".join((*module, alias.name)) for alias in node.names]
            yield from filter(is_private, (name for name in names if name != "__future__.annotations"))
        elif isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            texts = [a.value for a in node.args[:2] if isinstance(a, ast.Constant) and isinstance(a.value, str)]
            if called in PATCHES:
                yield from filter(is_private, texts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "import " in node.value:
            with contextlib.suppress(SyntaxError):
                yield from private_names(ast.parse(node.value))


def test_no_test_uses_a_private_name():
    assert len(TESTS) > 100
    used = {path: {*private_names(ast.parse(path.read_text()))} - ALLOWED for path in TESTS}
    assert {path.relative_to(ROOT).as_posix(): names for path, names in used.items() if names} == {}


def test_private_names_are_found_and_others_are_not():
    private = [
        "node._filter.poses", "self.node._filter", "from package.module import _helper", "import package._module",
        "monkeypatch.setattr(module, '_LIMIT', 3)", "monkeypatch.setattr('package.module._LIMIT', 3)",
        "run(['python', '-c', 'import package; package._LIMIT = 3'])",
    ]  # fmt: skip
    public = ["self._filter", "node.filter.__class__", "import package.module"]
    assert [line for line in [*private, *public] if [*private_names(ast.parse(line))]] == private
