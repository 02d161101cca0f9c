"""Executables of a package. A signal may stop one while it is still importing its modules, which takes a second.

If a module is not installed, the executable ends as with bad input: with one line that names the command to install it.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable

from .stop_signals import end_at_once


def executable(module: str) -> Callable[[], int]:
    """Return the function of an executable: when called, it imports the module of that name and runs its ``main``."""

    def main() -> int:
        end_at_once()
        try:
            loaded = importlib.import_module(module)
        except ModuleNotFoundError as error:
            from .errors import EXIT_BAD_INPUT
            from .missing_modules import how_to_install

            print(f"{module.rpartition('.')[2]}: error: {how_to_install(error)}", file=sys.stderr)
            return EXIT_BAD_INPUT
        return loaded.main()

    return main
