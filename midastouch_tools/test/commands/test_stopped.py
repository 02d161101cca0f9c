"""Commands that a signal ends, as of docker stop, and what they leave."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


def simulation(folder: Path) -> tuple[subprocess.Popen, Path]:
    """A simulation that has begun to write, and its temporary folder."""
    before = {*folder.glob(".a.*")}
    words = ["simulate", "handle_tool", "--length", "3", "--out", str(folder / "a")]
    process = subprocess.Popen(
        [sys.executable, "-m", "midastouch_tools.cli", *words], stderr=subprocess.PIPE, text=True
    )
    while not (new := {*folder.glob(".a.*")} - before):
        assert process.poll() is None
        time.sleep(0.01)
    return process, new.pop()


@pytest.mark.slow
def test_a_stopped_command_leaves_nothing_not_even_of_one_that_was_killed(tmp_path):
    process, left = simulation(tmp_path)
    with process:
        process.kill()
    assert [*tmp_path.iterdir()] == [left]
    process, fresh = simulation(tmp_path)
    assert [*tmp_path.iterdir()] == [fresh]
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate()
    assert process.returncode == 143
    assert said.splitlines()[-1] == "midastouch: interrupted"
    assert "Traceback" not in said
    assert [*tmp_path.iterdir()] == []


def test_a_command_whose_output_nobody_reads_on_ends_without_a_word():
    command = [sys.executable, "-m", "midastouch_tools.cli", "doctor"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 128 + signal.SIGPIPE
