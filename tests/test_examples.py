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


ARGUMENTS = {
    "localise_offline": [],
    "own_network": ["out/slide", POSES],
    "own_motion_model": ["out/slide"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_example_finds_the_sensor(name, folder):
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *ARGUMENTS[name]]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    last = done.stdout.splitlines()[-1]
    assert "converged" in last
    assert float(re.search(r"([\d.]+) mm", last)[1]) < 5


def test_every_example_is_run():
    assert set(ARGUMENTS) == {path.stem for path in EXAMPLES.glob("*.py")}
