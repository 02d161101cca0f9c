"""What a module imports of ours is defined there, also in a function or for types alone, which no run may reach."""

import ast
from collections.abc import Iterator
from importlib.util import resolve_name
from pathlib import Path

import packages

ROOT = Path(__file__).resolve().parent.parent


def missing_names(folders: list[Path]) -> list[str]:
    """Lines "module: name" of what modules of some packages import of one another from where it is not defined."""
    paths = [path.relative_to(folder.parent) for folder in folders for path in sorted(folder.rglob("*.py"))]
    names = {".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in paths}
    tops = {folder.name: folder.parent for folder in folders}
    trees = {name: ast.parse((tops[path.parts[0]] / path).read_text()) for name, path in names.items()}
    bound = {name: set(_bound(tree, offers=names[name].name == "__init__.py")) for name, tree in trees.items()}
    missing = []
    for name, tree in trees.items():
        package = name if names[name].name == "__init__.py" else name.rpartition(".")[0]
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom):
                continue
            source = resolve_name("." * node.level + (node.module or ""), package)
            if source in bound:
                wanted = [alias.name for alias in node.names]
                missing += [
                    f"{name}: {source}.{one}"
                    for one in wanted
                    if one not in bound[source] and f"{source}.{one}" not in names
                ]
    return missing


def _bound(tree: ast.Module, offers: bool) -> Iterator[str]:
    """Names that a module defines, or `offers` by importing them; libraries count."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Import | ast.ImportFrom if offers else ast.Import):
            yield from (alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def test_what_is_imported_is_there():
    assert missing_names([ROOT / package / package for package in packages.PYTHON]) == []


def test_what_is_not_there_is_found(tmp_path):
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "__init__.py").write_text("")
    (tmp_path / "pack" / "a.py").write_text("from .c import late\nHERE = 1\n")
    late = "def late():\n    from .a import HERE, GONE, late\n    from . import a, b\n"
    (tmp_path / "pack" / "c.py").write_text(late)
    assert missing_names([tmp_path / "pack"]) == ["pack.c: pack.a.GONE", "pack.c: pack.a.late", "pack.c: pack.b"]
