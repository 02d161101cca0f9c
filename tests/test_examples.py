"""The examples, run as their readers run them."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from midastouch_tools.cli import main
from midastouch_tools.processes.process import find_executable

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
}


ENGINES = {"simulated_finger": "rclpy", "mujoco_arm": "mujoco"}
"""Those that move a simulated sensor, beside the nodes that look for it, and what they need."""


def lines_of(name, arguments, folder):
    """What the example prints, until it ends."""
    command = [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def error_mm(line):
    return float(re.search(r"([\d.]+|nan) mm", line)[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_example_finds_the_sensor(name, folder):
    last = lines_of(name, ARGUMENTS[name], folder)[-1]
    # ambiguous, if the last frame falls between two comparisons of hypotheses
    assert re.search("converged|ambiguous", last)
    assert error_mm(last) < 5


@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_example_without_its_slide_says_how_to_make_it(name, tmp_path):
    done = subprocess.run([sys.executable, str(EXAMPLES / f"{name}.py")], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("out/slide: ")
    assert "\nmidastouch simulate handle_tool --seed 3 --out out/slide\n" in done.stderr


@pytest.fixture
def nodes(name, folder):
    """A simulated sensor and the localisation on the bundled tool."""
    pytest.importorskip(ENGINES[name], reason="not installed: tools/requirements/mujoco.txt")
    setups = [["midastouch", "run", setup, "object:=handle_tool"] for setup in ("digit_sim", "localization")]
    running = [subprocess.Popen([find_executable(program), *words], cwd=folder) for program, *words in setups]
    yield
    for process in running:
        process.send_signal(signal.SIGINT)
    assert [process.wait(timeout=60) for process in running] == [0, 0]


@pytest.mark.slow
@pytest.mark.dds
@pytest.mark.usefixtures("nodes")
@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_moves_a_sensor_that_is_found(name, folder):
    # where a live path ends depends on the load; there, other places may be under comparison again
    lines = lines_of(name, [], folder)
    sure = [error_mm(line) for line in lines if line.startswith("converged")]
    assert sure, lines
    assert max(sure) < 5, lines
    assert lines[-1].startswith(("converged", "ambiguous")), lines


def test_every_example_is_run():
    assert {*ARGUMENTS, *ENGINES} == {path.stem for path in EXAMPLES.glob("*.py")}
