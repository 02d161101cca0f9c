"""Check of what the set-up needs from a machine and cannot install."""

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

OLDEST, NEWEST = (3, 10), (3, 13)


class SetupError(Exception):
    """Error whose message tells the user what went wrong and how to fix it."""


def check_machine():
    """Raise SetupError if the machine lacks something that the set-up cannot install."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise SetupError(
            f"The ROS 2 wheels exist for Linux on x86-64 only, this is {platform.system()} on "
            f"{platform.machine()}. Use a system ROS 2 and colcon (CONTRIBUTING.md) or docker/; see docs/platforms.md."
        )
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        raise SetupError(
            f"Python {platform.python_version()} ({sys.executable}) is not supported: 3.10 to 3.13 are. "
            "Install one of them, then name it: make PYTHON=python3.12 ..."
        )
    if not shutil.which("cmake"):
        raise SetupError("cmake is missing. Debian, Ubuntu: sudo apt install cmake")
    if not (os.environ.get("CXX") or shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")):
        raise SetupError("There is no C++ compiler. Debian, Ubuntu: sudo apt install g++")
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    if not Path(sysconfig.get_paths()["include"], "Python.h").exists():
        raise SetupError(
            f"The C headers of {sys.executable} are missing. Debian, Ubuntu: sudo apt install python{version}-dev"
        )
    try:
        import ensurepip  # noqa: F401  (a package of its own on Debian and Ubuntu)
        import venv  # noqa: F401
    except ImportError:
        raise SetupError(
            f"{sys.executable} cannot make virtual environments. Debian, Ubuntu: sudo apt install python{version}-venv"
        ) from None


def use_supported_python():
    """Continue in another installed Python if this one is too old or too new."""
    if OLDEST <= sys.version_info[:2] <= NEWEST:
        return
    for minor in (12, 13, 11, 10):
        other = shutil.which(f"python3.{minor}")
        # Version managers put names on the path that do not work.
        if other and subprocess.call([other, "-c", ""], stderr=subprocess.DEVNULL) == 0:
            os.execv(other, [other, *sys.argv])
