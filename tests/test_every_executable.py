"""What holds for every executable that is a node, before its node exists."""

import importlib.metadata
import os
import signal
import subprocess
import sys

import packages
import pytest

SCRIPTS = {
    script.name: script.value
    for package in packages.PYTHON
    for script in importlib.metadata.distribution(package).entry_points.select(group="console_scripts")
}
NODES = [name for name in SCRIPTS if name != "midastouch"]
HELD_UP = "import sys\nprint('importing', flush=True)\nsys.stdin.readline()\n"


@pytest.mark.parametrize(
    ("name", "held_up", "number", "status"),
    [
        *((name, "rclpy", signal.SIGINT, 0) for name in NODES),
        (NODES[0], "rclpy", signal.SIGTERM, 0),
        ("midastouch", "yaml", signal.SIGINT, 130),
    ],
)
def test_a_signal_during_the_import_ends_it_at_once_and_well(name, held_up, number, status, tmp_path):
    (tmp_path / f"{held_up}.py").write_text(HELD_UP)
    module, function = SCRIPTS[name].split(":")
    process = subprocess.Popen(
        [sys.executable, "-c", f"import sys; from {module} import {function}; sys.exit({function}())"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "importing\n"
    process.send_signal(number)
    _, errors = process.communicate()
    assert (process.returncode, errors) == (status, "")
