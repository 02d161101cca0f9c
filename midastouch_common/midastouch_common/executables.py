"""Executables of a package. Importing what a node needs takes a second, in which a signal may already stop it.

What is not installed ends the executable as bad input does, with one line that says how to install it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable

from .errors import EXIT_BAD_INPUT
from .missing_modules import how_to_install
from .stop_signals import end_at_once


def executable(module: str) -> Callable[[], int]:
    """The function of an executable: ``main`` of the module of that name, which is imported only then."""

    def main() -> int:
        end_at_once()
        try:
            loaded = importlib.import_module(module)
        except ModuleNotFoundError as error:
            print(f"{module.rpartition('.')[2]}: error: {how_to_install(error)}", file=sys.stderr)
            return EXIT_BAD_INPUT
        return loaded.main()

    return main
