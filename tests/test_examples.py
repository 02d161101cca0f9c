"""The examples, run as their readers run them."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from midastouch_bringup.cli import main

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
POSES = "4000"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A short slide and its codebook, where the examples look for them."""
    folder = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["simulate", "handle_tool", "--seed", "3", "--length", "0.25", "--out", "out/slide"]) == 0
        assert main(["build-codebook", "handle_tool", "--size", POSES]) == 0
    return folder


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("localise_offline", []),
        ("own_network", ["out/slide", POSES]),
        ("own_motion_model", ["out/slide"]),
    ],
)
def test_an_example_finds_the_sensor(name, arguments, folder):
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    last = done.stdout.splitlines()[-1]
    assert "converged" in last
    assert float(re.search(r"([\d.]+) mm", last)[1]) < 5


def test_every_example_is_run():
    marks = test_an_example_finds_the_sensor.pytestmark
    assert {name for name, _ in marks[0].args[1]} == {path.stem for path in EXAMPLES.glob("*.py")}
