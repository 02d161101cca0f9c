"""Numbers in the code of `midastouch_filter`, read without running it: of modules, and defaults of data classes."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent / "midastouch_filter" / "midastouch_filter"
CLASSES = {"core/noise_model.py": ("NoiseModel",), "core/config.py": ("FilterConfig",)}
_FIELDS = ("_number", "_switch")  # of FilterConfig: the default is the first argument
_CALCULATION = (
    ast.Constant, ast.Tuple, ast.List, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.Call, ast.Name,
    ast.Attribute, ast.Load, ast.Slice, ast.Subscript,
)  # fmt: skip
_CALLED = ("np", "math", "round", "_diagonal")


def constants() -> dict[tuple[str, str], str]:
    """Value as it is written, by file in the package and name; `_A, _B = 1, 2` is two of them."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        file = path.relative_to(ROOT).as_posix()
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and node.name in CLASSES.get(file, ()):
                found |= {(file, name): ast.unparse(value) for name, value in _defaults(node)}
            else:
                found |= {(file, name): ast.unparse(value) for name, value in _assigned(node) if _numeric(value)}
    return found


def _assigned(node: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Names that a statement of a module gives values to."""
    if isinstance(node, ast.AnnAssign) and node.value:
        yield ast.unparse(node.target), node.value
    elif isinstance(node, ast.Assign):
        for target in node.targets:
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                yield from zip(map(ast.unparse, target.elts), node.value.elts, strict=True)
            else:
                yield ast.unparse(target), node.value


def _defaults(node: ast.ClassDef) -> Iterator[tuple[str, ast.expr]]:
    """Fields of a data class that have one."""
    for name, value in (pair for field in node.body for pair in _assigned(field)):
        chosen = isinstance(value, ast.Call) and ast.unparse(value.func) in _FIELDS
        yield name, value.args[0] if chosen else value


def _numeric(value: ast.expr) -> bool:
    """Whether numbers are all that an expression is made of."""
    parts = list(ast.walk(value))
    numbers = [p.value for p in parts if isinstance(p, ast.Constant)]
    calls = [ast.unparse(p.func).split(".")[0] for p in parts if isinstance(p, ast.Call)]
    return (
        all(isinstance(p, _CALCULATION) for p in parts)
        and bool(numbers)
        and all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in numbers)
        and all(name in _CALLED for name in calls)
    )
