"""What a module imports of ours is defined there, also in a function or for types alone, which no run may reach."""

import ast
from collections.abc import Iterable, Iterator
from pathlib import Path

import packages

ROOT = Path(__file__).resolve().parent.parent


def missing_names(modules: dict[str, Path], users: Iterable[Path] = ()) -> list[str]:
    """Lines "module: name" of what modules, and other files, import from where it is not defined."""
    trees = {name: ast.parse(path.read_text()) for name, path in modules.items()}
    inner = {name: {*_bound(tree, offers=modules[name].name == "__init__.py")} for name, tree in trees.items()}
    outer = {name: {*_bound(tree, offers=True)} for name, tree in trees.items()}
    missing = []
    for bound, files in ((inner, modules), (outer, {str(path): path for path in users})):
        for name, path in files.items():
            for _, source, names in packages.imports(path):
                if "__getattr__" not in bound.get(source, {"__getattr__"}):  # which makes names up
                    wanted = [one for one in names if one not in bound[source] and f"{source}.{one}" not in modules]
                    missing += [f"{name}: {source}.{one}" for one in sorted(wanted)]
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
    modules = {name: path for package in packages.PYTHON for name, path in packages.modules(package).items()}
    assert missing_names(modules, tests) == []


def test_what_is_not_there_is_found(tmp_path):
    (tmp_path / "pack").mkdir()
    late = "def late():\n    from .a import HERE, GONE, late\n    from . import a, b\n"
    texts = {"pack.__init__": "", "pack.a": "from .c import late\nHERE = 1\n", "pack.c": late}
    modules = {name: tmp_path / f"{name.replace('.', '/')}.py" for name in texts}
    for name, path in modules.items():
        path.write_text(texts[name])
    modules["pack"] = modules.pop("pack.__init__")
    (tmp_path / "test.py").write_text("from pack import a, gone\n")
    found = missing_names(modules, [tmp_path / "test.py"])
    assert found == ["pack.c: pack.a.GONE", "pack.c: pack.a.late", "pack.c: pack.b", f"{tmp_path}/test.py: pack.gone"]
