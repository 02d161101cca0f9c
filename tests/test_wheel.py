"""The wheel, built and installed into an empty environment: without ROS, the README's lines and the notebook find the
sensor there."""

import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documents import blocks, section

pytestmark = pytest.mark.slow
# of a workspace or a ROS that is sourced here
_OF_HERE = ("AMENT_", "CMAKE_", "COLCON_", "PYTHON", "RMW_", "ROS", "_ROS")


class Empty:
    """An environment of Python with nothing but the wheel, and a folder to work in."""

    def __init__(self, environment: Path, folder: Path):
        self.folder, self._bin = folder, environment / "bin"

    def run(self, *command: str | Path) -> subprocess.CompletedProcess:
        """A program of the environment, in the folder."""
        variables = {name: value for name, value in os.environ.items() if not name.startswith(_OF_HERE)}
        variables["PATH"] = f"{self._bin}{os.pathsep}{os.environ['PATH']}"
        return subprocess.run(command, cwd=self.folder, env=variables, capture_output=True, text=True)

    def text(self, *command: str | Path) -> str:
        """What the program prints; it must succeed."""
        done = self.run(*command)
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture(scope="module")
def empty(root, tmp_path_factory) -> Empty:
    """With a recording and a codebook, made as the README says."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, "-m", "venv", folder / "environment"], check=True)
    empty = Empty(folder / "environment", folder)
    pip = ["pip", "--disable-pip-version-check"]
    empty.text(*pip, "wheel", "--no-deps", "--wheel-dir", ".", root)
    requirements = root / "tools" / "requirements"
    tested = ["--constraint", requirements / "base.txt", "--requirement", requirements / "notebook.txt"]
    empty.text(*pip, "install", *tested, next(folder.glob("*.whl")))
    for line in _of_the_readme(""):
        empty.text(*line.split())
    return empty


def _of_the_readme(language: str) -> list[str]:
    """Lines of its block in a language; without one, what is typed."""
    (block,) = blocks(section("README.md", "## Without ROS"), language)
    return block.splitlines()


def millimetres(line: str) -> float:
    return float(re.fullmatch(r"converged, ([\d.]+) mm off.*", line)[1])


def test_the_lines_of_the_readme_find_the_sensor(empty):
    lines = _of_the_readme("python")
    assert len([line for line in lines if line]) <= 20
    assert millimetres(empty.text("python", "-c", "\n".join(lines)).strip()) < 5


def test_the_notebook_draws_how_it_is_found(empty, root):
    shutil.copy(root / "examples" / "localise.ipynb", empty.folder)
    empty.text("jupyter-execute", "--inplace", "localise.ipynb")
    outputs = [
        output
        for cell in json.loads((empty.folder / "localise.ipynb").read_text())["cells"]
        for output in cell.get("outputs", [])
    ]
    assert [output for output in outputs if "image/png" in output.get("data", {})]
    assert millimetres("".join(outputs[-1]["text"]).strip()) < 5


def test_the_wheel_says_what_it_is_and_what_it_lacks(empty):
    version = importlib.metadata.version("midastouch_tools")
    assert empty.text("midastouch", "--version") == f"midastouch {version}\n"
    done = empty.run("midastouch", "run", "demo")
    assert done.returncode == 2
    assert done.stderr.startswith("midastouch: error: run: this needs ROS 2, and there is no module midastouch_")
