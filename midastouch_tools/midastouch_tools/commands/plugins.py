"""Sub-commands that other packages add by entry points."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
from types import ModuleType

from midastouch_common.errors import InputError

PLUGINS = "midastouch.commands"
"""Entry-point group in which other packages register commands, each a module like those of `commands`."""


class BrokenCommand:
    """Stand-in for a command of another package that cannot be imported; all others, such as `doctor`, still work."""

    def __init__(self, name: str, error: Exception):
        self.name, self.problem = name, problem_of(error)

    def add_parser(self, subparsers) -> None:
        """Add the sub-command, which accepts any arguments and reports the problem."""
        # no argument counts as an option, not even --help
        parser = subparsers.add_parser(self.name, help="cannot be loaded", add_help=False, prefix_chars="\0")
        parser.add_argument("anything", nargs="*")
        parser.set_defaults(run=self._refuse)

    def _refuse(self, _args: argparse.Namespace) -> int:
        raise InputError(f"{self.name}: cannot be loaded, {self.problem}; see midastouch doctor")


def commands_of_others() -> list[ModuleType | BrokenCommand]:
    """Return the commands of other packages, sorted by name: those of midastouch_benchmark if it is installed."""
    found = importlib.metadata.entry_points(group=PLUGINS)
    return [_loaded(one) for one in sorted(found, key=lambda one: one.name)]


def _loaded(found: importlib.metadata.EntryPoint) -> ModuleType | BrokenCommand:
    try:
        command = found.load()
        _ = command.add_parser  # a module that is no command fails here
        return command
    except Exception as error:  # a broken install can fail in any way while it is imported
        return BrokenCommand(found.name.replace("_", "-"), error)


def problem_of(error: Exception) -> str:
    """Return the type of an error and its description in one line."""
    return f"{type(error).__name__}: {one_line(error)}"


def one_line(error: Exception) -> str:
    """Describe an error in one line."""
    if isinstance(error, FileExistsError):  # raised when a folder was to be made there
        return f"{error.filename}: exists and is no folder; choose another place"
    if isinstance(error, OSError) and error.filename is not None and error.errno is not None:
        return f"{error.filename}: {os.strerror(error.errno)}"
    return " ".join(str(error).split()) or type(error).__name__
