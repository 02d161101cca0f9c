"""What the real launch does not have: the commands of a launch file, for a program that runs them itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from .actions import IncludeLaunchDescription
from .launch_description_sources import PythonLaunchDescriptionSource
from .service import LaunchService


class _Commands(LaunchService):
    """Collects commands by name instead of running them; parameters that are no files go to `folder`."""

    def __init__(self, folder: Path):
        super().__init__()
        self.folder = folder
        self.commands: dict[str, list[str]] = {}

    def start(self, action, name: str, command: list[str]) -> None:
        """Collect the command."""
        self.commands[name] = command


def commands(launch_file: str | Path, arguments: Mapping[str, str], folder: Path) -> dict[str, list[str]]:
    """Return the command of each process that a launch file starts, by the name of its executable.

    folder: for files with parameters. Raises what its actions raise.
    """
    service = _Commands(folder)
    source = PythonLaunchDescriptionSource(str(launch_file))
    service.visit([IncludeLaunchDescription(source, launch_arguments=arguments.items())])
    return service.commands
