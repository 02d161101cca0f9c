"""The load for tests on a busy machine."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("ending", ["sys.exit(3)", "os.kill(os.getppid(), 9)"])
def test_every_core_is_busy_until_the_command_has_ended(root, ending):
    command = [sys.executable, "-c", f"import os, sys, time; print(os.getppid(), flush=True); input(); {ending}"]
    loaded = subprocess.Popen(
        [sys.executable, root / "tools" / "load.py", *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    parent = int(loaded.stdout.readline())
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    assert len(children) == len(os.sched_getaffinity(0)) + 1
    loaded.communicate("\n")  # returns when nobody holds the pipe any more: all have ended
    assert loaded.returncode == (3 if "exit" in ending else -9)
