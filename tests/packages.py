"""The packages of the workspace, each after those that it may import; their modules and imports."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.util import resolve_name
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CMAKE = ["midastouch_msgs", "midastouch_kernels"]
PYTHON = [
    "midastouch_common",
    "digit_driver",
    "midastouch_perception",
    "midastouch_filter",
    "midastouch_motion",
    "midastouch_bringup",
    "midastouch_simulation",
    "midastouch_tools",
    "midastouch_benchmark",
]
WITH_MODULES = ["midastouch_kernels", *PYTHON]


def modules(package: str) -> dict[str, Path]:
    """Files of a package by the dotted names of its modules."""
    return {
        ".".join(path.relative_to(ROOT / package).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted((ROOT / package / package).rglob("*.py"))
    }


def imports(path: Path) -> list[tuple[int, str, list[str]]]:
    """(line, absolute module, names) of every import in a file, at whatever depth of the code; `import a` has none."""
    top = next(folder for folder in path.parents if not (folder / "__init__.py").exists())
    package = ".".join(path.parent.relative_to(top).parts)
    found = []
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name, []) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = (
                resolve_name("." * node.level + (node.module or ""), package)
                if node.level and package
                else node.module or ""
            )
            found.append((node.lineno, module, [alias.name for alias in node.names]))
    return found


def loaded_by(code: str) -> set[str]:
    """Top-level names of all that a Python of its own has loaded after this code."""
    code += "\nimport sys\nprint(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT / "tests", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())
