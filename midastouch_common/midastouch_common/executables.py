"""Executables of a package. Importing what a node needs takes a second, in which a signal may already stop it."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from .stop_signals import end_at_once


def executable(module: str) -> Callable[[], int]:
    """The function of an executable: ``main`` of the module of that name, which is imported only then."""

    def main() -> int:
        end_at_once()
        return importlib.import_module(module).main()

    return main
