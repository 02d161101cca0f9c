"""One program as a process: found, started so that it does not outlive us, read line by line, ended gently."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from midastouch_common.errors import InputError
from midastouch_common.stop_signals import bound_to_us

_OURS = ("perception", "filter", "motion", "simulation", "bringup", "tools")
_PACKAGES = ("digit_driver", *(f"midastouch_{name}" for name in _OURS))


@dataclass(frozen=True)
class Program:
    """Program to run. `ends`: True if it ends by itself once its work is done; it is then never started again."""

    name: str
    command: tuple[str, ...]
    ends: bool = False


def node_program(executable: str, parameters: Path, ends: bool = False) -> Program:
    """Return one of our executables with a parameter file. Raises as `find_executable`."""
    return Program(executable, (find_executable(executable), "--ros-args", "--params-file", str(parameters)), ends)


def find_executable(name: str) -> str:
    """Return the path of one of our executables: in a colcon install, next to this Python, or on PATH.

    Raises InputError with the fix when there is none.
    """
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    installed = [str(Path(prefix, "lib", package)) for prefix in prefixes for package in _PACKAGES]
    ours = [*installed, str(Path(sys.executable).parent)]
    if found := shutil.which(name, path=os.pathsep.join(ours)) or shutil.which(name):
        return found
    raise InputError(f"executable '{name}' is not installed; run make, or build and source the workspace")


@functools.cache
def _ours() -> frozenset[str]:
    scripts = importlib.metadata.entry_points(group="console_scripts")
    return frozenset(each.name for each in scripts if ".executables:" in each.value)


GRACE_S = (8.0, 4.0, 4.0)  # after SIGINT, SIGTERM, SIGKILL
LAST_OUTPUT_S = 1.0
_LAST_LINES = 15

Output = Callable[[str, str], None]
"""Function of the name of a program and a line that it has printed; called by one thread per process."""


class Process:
    """Process of a program, started by the constructor. Attribute: last_lines: the newest that it has printed."""

    def __init__(self, program: Program, environment: Mapping[str, str], output: Output):
        self._born, self._executable = time.monotonic(), Path(program.command[0]).name
        self.last_lines: deque[str] = deque(maxlen=_LAST_LINES)
        # a session of its own: Ctrl-C reaches only us, and we end all in order
        self._popen = subprocess.Popen(
            bound_to_us(program.command),
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read, args=[program.name, output], daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._popen.pid

    @property
    def age(self) -> float:
        """Seconds since its start."""
        return time.monotonic() - self._born

    @property
    def begins(self) -> bool:
        """True for one of our executables that has printed nothing yet: they handle signals once they have."""
        return not self.last_lines and self._executable in _ours()

    @property
    def runs(self) -> bool:
        """True until it has ended."""
        return self._popen.poll() is None

    def status(self) -> int | None:
        """Return the exit status, -N after signal N; None while it runs."""
        status = self._popen.poll()
        if status is not None:
            # its last output comes before our report of its end; a process that it left behind may hold the pipe open
            self._reader.join(LAST_OUTPUT_S)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        self._popen.send_signal(number)

    def wait(self, seconds: float) -> None:
        """Wait until it has ended, for at most `seconds`."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(max(0.0, seconds))

    def _read(self, name: str, output: Output) -> None:
        with self._popen.stdout:
            for raw in self._popen.stdout:
                line = raw.decode(errors="replace").rstrip("\r\n")
                self.last_lines.append(line)
                # the reader may be gone, or the disk full; the program continues
                with contextlib.suppress(OSError):
                    output(name, line)


def end(processes: Iterable[Process], await_ends: Callable[[list[Process], float], object] | None = None) -> None:
    """End processes: SIGINT first, then SIGTERM, then SIGKILL for those that do not go. Those that `begins` are spared
    SIGINT, for which Python prints a traceback until they handle it.

    await_ends(processes, seconds) returns once all of them have ended, or time is up. An exception from it, such as
    KeyboardInterrupt, kills those that are left at once.
    """
    processes = list(processes)
    try:
        for number, grace in zip((signal.SIGINT, signal.SIGTERM, signal.SIGKILL), GRACE_S, strict=True):
            left = [process for process in processes if process.runs]
            for process in left:
                process.send_signal(signal.SIGTERM if number == signal.SIGINT and process.begins else number)
            if left:
                (await_ends or _await_ends)(left, grace)
    finally:
        for process in processes:
            process.send_signal(signal.SIGKILL)


def _await_ends(processes: list[Process], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    for process in processes:
        process.wait(deadline - time.monotonic())


def resident_mb(pid: int) -> float:
    """Resident memory of a process, MiB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
