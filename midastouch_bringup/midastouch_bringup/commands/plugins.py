"""Sub-commands that other packages bring, by entry points."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
from types import ModuleType

from midastouch_common.errors import InputError

PLUGINS = "midastouch.commands"
"""Group of the entry points by which other packages bring commands, each a module as those of `commands`."""


class BrokenCommand:
    """Stands for a command of another package that cannot be imported: all others work, `doctor` among them."""

    def __init__(self, name: str, error: Exception):
        self.name, self.problem = name, f"{type(error).__name__}: {one_line(error)}"

    def add_parser(self, subparsers) -> None:
        """Add the sub-command, which takes whatever is given and says what is wrong."""
        # no argument is an option to it, not even --help
        parser = subparsers.add_parser(self.name, help="cannot be loaded", add_help=False, prefix_chars="\0")
        parser.add_argument("anything", nargs="*")
        parser.set_defaults(run=self._refuse)

    def _refuse(self, _args: argparse.Namespace) -> int:
        raise InputError(f"{self.name}: cannot be loaded, {self.problem}; see midastouch doctor")


def commands_of_others() -> list[ModuleType | BrokenCommand]:
    """What other packages bring, by name: those of midastouch_benchmark, where that is installed."""
    found = importlib.metadata.entry_points(group=PLUGINS)
    return [_loaded(one) for one in sorted(found, key=lambda one: one.name)]


def _loaded(found: importlib.metadata.EntryPoint) -> ModuleType | BrokenCommand:
    try:
        command = found.load()
        _ = command.add_parser  # what is no command fails here, too
        return command
    except Exception as error:  # a broken install can fail in any way while it is imported
        return BrokenCommand(found.name.replace("_", "-"), error)


def one_line(error: Exception) -> str:
    """What is wrong, in one line."""
    if isinstance(error, FileExistsError):  # a folder was to be made there
        return f"{error.filename}: exists and is no folder; choose another place"
    if isinstance(error, OSError) and error.filename is not None and error.errno is not None:
        return f"{error.filename}: {os.strerror(error.errno)}"
    return " ".join(str(error).split()) or type(error).__name__
