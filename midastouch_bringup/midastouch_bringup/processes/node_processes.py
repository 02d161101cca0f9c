"""Nodes as processes of their own, started together, watched, and stopped cleanly."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from midastouch_perception.errors import InputError

_GRACE_S = (8.0, 4.0, 4.0)  # after SIGINT, SIGTERM, SIGKILL
_TAIL_LINES = 15
_PACKAGES = ("digit_driver", "midastouch_perception", "midastouch_filter", "midastouch_bringup")


class NodeFailed(RuntimeError):
    """A node ended that should have gone on, or ended badly; the message holds the end of its log."""


class NodeProcesses:
    """Executables started as nodes in one ROS domain that only this machine sees; `with` stops them all.

    Args: folder, for their logs; domain, ROS_DOMAIN_ID of all of them.
    """

    def __init__(self, folder: Path, domain: int):
        self._folder = folder
        self._environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder.resolve()),
        }
        self._processes: dict[str, subprocess.Popen] = {}
        self._parameters: dict[str, Path] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> NodeProcesses:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self, executable: str, parameters: Path) -> None:
        """Start an executable with a parameter file; its output goes to `<executable>.log`.

        Raises InputError, naming the mend, when it is not installed.
        """
        self._parameters[executable] = parameters
        self._log(executable).unlink(missing_ok=True)
        self._launch(executable)

    def revive(self) -> list[str]:
        """Start those again that have ended, however they ended; returns their names. Their logs go on."""
        ended = [name for name, process in self._processes.items() if process.poll() is not None]
        for name in ended:
            self._launch(name)
        return ended

    @property
    def pids(self) -> dict[str, int]:
        """Process id of each executable that was started, as of its last start."""
        return {name: process.pid for name, process in self._processes.items()}

    def _launch(self, executable: str) -> None:
        command = [find_executable(executable), "--ros-args", "--params-file", str(self._parameters[executable])]
        with self._log(executable).open("ab") as log:
            # a session of its own: Ctrl-C reaches this process alone, which then stops them in order
            self._processes[executable] = subprocess.Popen(
                bound_to_us(command),
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def running(self, executable: str) -> bool:
        """Whether a process goes on. Raises NodeFailed when it ended with another status than 0."""
        status = self._processes[executable].poll()
        if status:
            raise NodeFailed(f"{executable} ended with status {status}; the end of its log:\n{self._tail(executable)}")
        return status is None

    def check(self, *executables: str) -> None:
        """Raise NodeFailed when one of the processes has ended."""
        for executable in executables:
            if not self.running(executable):
                raise NodeFailed(f"{executable} ended too early; the end of its log:\n{self._tail(executable)}")

    def stop(self) -> None:
        """End all processes."""
        end(self._processes.values())

    def _log(self, executable: str) -> Path:
        return self._folder / f"{executable}.log"

    def log(self, executable: str) -> str:
        """What a process has printed so far."""
        return self._log(executable).read_text(errors="replace")

    def _tail(self, executable: str) -> str:
        lines = self.log(executable).rstrip().splitlines()
        return "\n".join("  " + line for line in lines[-_TAIL_LINES:]) or "  (empty)"


def end(
    processes: Iterable[subprocess.Popen],
    await_ends: Callable[[list[subprocess.Popen], float], None] | None = None,
) -> None:
    """End processes: SIGINT first, then SIGTERM, then SIGKILL for those that do not go.

    await_ends(processes, seconds) returns once all of them have ended, or after so long.
    """
    processes = list(processes)
    for number, grace in zip((signal.SIGINT, signal.SIGTERM, signal.SIGKILL), _GRACE_S, strict=True):
        left = [process for process in processes if process.poll() is None]
        for process in left:
            process.send_signal(number)
        if left:
            (await_ends or _await_ends)(left, grace)


def _await_ends(processes: list[subprocess.Popen], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    for process in processes:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, deadline - time.monotonic()))


def bound_to_us(command: Sequence[str | os.PathLike]) -> list[str | os.PathLike]:
    """The command of a child that gets SIGTERM when the thread that has started it, and so this process, is gone.

    Also after SIGKILL, which leaves a parent no time to end its children: they would go on, invisibly, with the sensor
    and the topics in their hands. Without `setpriv` (util-linux, part of every Debian and Ubuntu) the command as it is.
    """
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "TERM", "--", *command] if setpriv else [*command]


def find_executable(name: str) -> str:
    """Path of one of our executables: in a colcon install, beside this Python, or on PATH.

    Raises InputError with the mend when there is none.
    """
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    installed = [str(Path(prefix, "lib", package)) for prefix in prefixes for package in _PACKAGES]
    ours = [*installed, str(Path(sys.executable).parent)]
    if found := shutil.which(name, path=os.pathsep.join(ours)) or shutil.which(name):
        return found
    raise InputError(f"executable '{name}' is not installed; run make, or build and source the workspace")


def resident_mb(pid: int) -> float:
    """Resident memory of a process, MiB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
