"""What can be run as a process: our executables, and where they are."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from midastouch_common.errors import InputError

_PACKAGES = ("digit_driver", "midastouch_perception", "midastouch_filter", "midastouch_bringup")


@dataclass(frozen=True)
class Program:
    """What to run. `ends`: it ends by itself, once its work is done, and is never started again."""

    name: str
    command: tuple[str, ...]
    ends: bool = False


def node_program(executable: str, parameters: Path, options: Sequence[str] = (), ends: bool = False) -> Program:
    """One of our executables with a parameter file, and further options for ROS. Raises as `find_executable`."""
    command = (find_executable(executable), "--ros-args", "--params-file", str(parameters), *options)
    return Program(executable, command, ends)


def find_executable(name: str) -> str:
    """Path of one of our executables: in a colcon install, beside this Python, or on PATH.

    Raises InputError with the mend when there is none.
    """
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    installed = [str(Path(prefix, "lib", package)) for prefix in prefixes for package in _PACKAGES]
    ours = [*installed, str(Path(sys.executable).parent)]
    if found := shutil.which(name, path=os.pathsep.join(ours)) or shutil.which(name):
        return found
    raise InputError(f"executable '{name}' is not installed; run make, or build and source the workspace")
