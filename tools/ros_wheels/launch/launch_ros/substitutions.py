"""Places in packages."""

from __future__ import annotations

import sys
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.substitution import Substitution, perform


class ExecutableInPackage(Substitution):
    """Path of an executable: in the package's folder, as colcon installs it, or beside this Python."""

    def __init__(self, executable, package):
        self._executable, self._package = executable, package

    def perform(self, context) -> str:
        """Return it. Raises RuntimeError if it is not there."""
        executable, package = perform(context, self._executable), perform(context, self._package)
        try:
            prefix = Path(get_package_prefix(package))
        except PackageNotFoundError as error:
            debian = package.replace("_", "-")
            raise RuntimeError(f"{package} is not installed: sudo apt install ros-$ROS_DISTRO-{debian}") from error
        for path in (prefix / "lib" / package / executable, Path(sys.executable).with_name(executable)):
            if path.is_file():
                return str(path)
        raise RuntimeError(f"executable '{executable}' of {package} is not installed; run make")
