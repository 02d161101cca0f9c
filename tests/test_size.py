"""The workspace does not grow unnoticed: lines of product and tests stay within the numbers of pyproject.toml.

A change that needs more raises a number in the same commit, and its message says why; one that needs less lowers it.
"""

import re
from pathlib import Path

import packages
import pytest

ROOT = packages.ROOT
PRODUCT = [ROOT / name / name for name in packages.PYTHON] + [
    ROOT / "midastouch_kernels" / "src",
    ROOT / "midastouch_kernels" / "midastouch_kernels",
    ROOT / "midastouch_msgs",
    ROOT / "midastouch_bringup" / "launch",
    ROOT / "tools",
]
TESTS = [*ROOT.glob("*/test"), ROOT / "tests"]
SOURCES = {".py", ".cpp", ".hpp", ".msg", ".srv", ".action"}
_SLACK = 0.01  # of a number, which a change need not lower


def lines(folders: list[Path]) -> int:
    """Lines of the sources in folders."""
    files = {path for folder in folders for path in folder.rglob("*") if path.suffix in SOURCES}
    return sum(path.read_bytes().count(b"\n") for path in files)


@pytest.mark.parametrize(("kind", "folders"), [("product", PRODUCT), ("tests", TESTS)])
def test_lines_stay_within_the_number_of_pyproject(kind, folders):
    most = int(re.search(rf"^{kind}_lines = (\d+)$", (ROOT / "pyproject.toml").read_text(), flags=re.M)[1])
    found = lines(folders)
    assert found <= most, "take something away, or raise the number and say why"
    assert found >= (1.0 - _SLACK) * most, f"lower {kind}_lines in pyproject.toml to {found}"
