"""What a module imports of ours is defined there, also in a function or for types alone, which no run may reach."""

import ast
from collections.abc import Iterable, Iterator
from importlib.util import resolve_name
from pathlib import Path

import packages

ROOT = Path(__file__).resolve().parent.parent


def missing_names(folders: list[Path], users: Iterable[Path] = ()) -> list[str]:
    """Lines "module: name" of what modules of some packages, and other files, import from where it is not defined."""
    paths = [path.relative_to(folder.parent) for folder in folders for path in sorted(folder.rglob("*.py"))]
    names = {".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in paths}
    tops = {folder.name: folder.parent for folder in folders}
    trees = {name: ast.parse((tops[path.parts[0]] / path).read_text()) for name, path in names.items()}
    bound = {name: set(_bound(tree, offers=names[name].name == "__init__.py")) for name, tree in trees.items()}
    missing = []
    for name, tree in (trees | {str(path): ast.parse(path.read_text()) for path in users}).items():
        inside = name in names
        package = name if inside and names[name].name == "__init__.py" else name.rpartition(".")[0]
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom) or (node.level and not inside):
                continue
            source = resolve_name("." * node.level + (node.module or ""), package)
            if source in bound and "__getattr__" not in bound[source]:  # which makes names up
                there = bound[source] if inside else {*_bound(trees[source], offers=True)}
                wanted = {alias.name for alias in node.names} - there
                missing += [f"{name}: {source}.{one}" for one in sorted(wanted) if f"{source}.{one}" not in names]
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
    tests = [*ROOT.glob("tests/**/*.py"), *ROOT.glob("*/test/**/*.py"), *ROOT.glob("examples/*.py")]
    assert missing_names([ROOT / package / package for package in packages.PYTHON], tests) == []


def test_what_is_not_there_is_found(tmp_path):
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "__init__.py").write_text("")
    (tmp_path / "pack" / "a.py").write_text("from .c import late\nHERE = 1\n")
    late = "def late():\n    from .a import HERE, GONE, late\n    from . import a, b\n"
    (tmp_path / "pack" / "c.py").write_text(late)
    (tmp_path / "test.py").write_text("from pack import a, gone\n")
    assert missing_names([tmp_path / "pack"], [tmp_path / "test.py"])[3:] == [f"{tmp_path}/test.py: pack.gone"]
    assert missing_names([tmp_path / "pack"]) == ["pack.c: pack.a.GONE", "pack.c: pack.a.late", "pack.c: pack.b"]
