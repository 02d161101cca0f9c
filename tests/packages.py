"""The packages of the workspace, each after those that it may import; their modules and imports."""

from __future__ import annotations

import ast
import subprocess
import sys
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


def imports(path: Path) -> list[tuple[int, str]]:
    """(line, absolute module name) of every import in a file, at whatever depth of the code."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.append((node.lineno, node.module))
    return found


def loaded_by(code: str) -> set[str]:
    """Top-level names of all that a Python of its own has loaded after this code."""
    code += "\nimport sys\nprint(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT / "tests", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())
