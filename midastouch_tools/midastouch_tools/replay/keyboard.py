"""Single key presses from the terminal, without waiting for Enter."""

from __future__ import annotations

import contextlib
import os
import re
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Mapping
from typing import Any

_POLL_S = 0.1
# Codes that a terminal sends for the arrow keys (ECMA-48).
_NAMES = {"\x1b[A": "up", "\x1b[B": "down", "\x1b[C": "right", "\x1b[D": "left"}


def _standard_input() -> int | None:
    """Return the descriptor of standard input; None if it was closed."""
    try:
        return sys.stdin.fileno() if sys.stdin else None
    except ValueError:
        return None


class Keyboard:
    """Listener that calls `keys[name]()` for each press of a key: a character, or `up`, `down`, `left`, `right`.

    It does nothing unless `file` is a terminal; `with` restores the terminal. Ctrl-C still interrupts.
    The calls come from a thread of its own.
    """

    def __init__(self, keys: Mapping[str, Callable[[], object]], file: int | None = None):
        self._keys, self._file = keys, _standard_input() if file is None else file
        self._before: list[Any] | None = None
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._read, name="keyboard", daemon=True)

    def __enter__(self) -> Keyboard:
        # A process in the background is stopped by the system when it changes its terminal.
        if self._file is not None and os.isatty(self._file) and os.tcgetpgrp(self._file) == os.getpgrp():
            self._before = termios.tcgetattr(self._file)
            tty.setcbreak(self._file)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            self._stopped.set()
            self._thread.join()
            with contextlib.suppress(termios.error):  # the terminal is gone
                termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)

    @property
    def active(self) -> bool:
        """True once it listens."""
        return self._before is not None

    def _read(self) -> None:
        while not self._stopped.is_set():
            if not select.select([self._file], [], [], _POLL_S)[0]:
                continue
            try:
                pressed = os.read(self._file, 16).decode(errors="replace")
            except OSError:
                pressed = ""
            if not pressed:
                return  # the terminal is gone
            for key in re.findall(r"\x1b\[[A-D]|.", pressed, re.DOTALL):
                self._keys.get(_NAMES.get(key, key), lambda: None)()
