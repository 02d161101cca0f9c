"""What holds for every executable that is a node, before its node exists."""

import importlib.metadata
import os
import signal
import subprocess
import sys

import packages
import pytest

NODES = {
    script.name: script.value
    for package in packages.PYTHON
    for script in importlib.metadata.distribution(package).entry_points.select(group="console_scripts")
    if script.name != "midastouch"
}
HELD_UP = "import sys\nprint('importing', flush=True)\nsys.stdin.readline()\n"


@pytest.mark.parametrize(
    ("name", "number"), [*((name, signal.SIGINT) for name in NODES), (next(iter(NODES)), signal.SIGTERM)]
)
def test_a_signal_during_the_import_ends_it_at_once_and_well(name, number, tmp_path):
    (tmp_path / "rclpy.py").write_text(HELD_UP)
    module, function = NODES[name].split(":")
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
    assert (process.returncode, errors) == (0, "")
