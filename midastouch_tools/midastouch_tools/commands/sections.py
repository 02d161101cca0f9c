"""The list of sub-commands in the help of `midastouch`, by purpose."""

from __future__ import annotations

import argparse
import shutil
import textwrap

_INDENT = 24  # columns before the summary


class Section:
    """Stand-in for argparse's sub-parsers, which know no headings, as the argument of a command's `add_parser`.

    Attributes: title; parsers, by name of the command.
    """

    def __init__(self, title: str, subparsers):
        self.title, self._subparsers = title, subparsers
        self.parsers: dict[str, argparse.ArgumentParser] = {}
        self._summaries: dict[str, str] = {}

    def add_parser(self, name: str, help: str = "-", **options):  # noqa: A002  the name that argparse gives it
        """Add a parser as argparse does; help: the summary, which only this section lists."""
        self._summaries[name] = help
        self.parsers[name] = self._subparsers.add_parser(name, **options)
        return self.parsers[name]

    def listed(self) -> str:
        """Return the title and the commands with their summaries, wrapped to the width of the terminal."""
        width = shutil.get_terminal_size().columns - 2
        lines = [
            textwrap.fill(
                summary,
                max(width, 2 * _INDENT),
                initial_indent=f"  {name}".ljust(_INDENT - 1) + " ",
                subsequent_indent=" " * _INDENT,
            )
            for name, summary in self._summaries.items()
        ]
        return "\n".join([f"{self.title}:", *lines])
