"""A launch description carried out: its processes started, watched, and ended together."""

from __future__ import annotations

import os
from collections.abc import Iterable

from midastouch_common.files import temporary_folder
from midastouch_tools.processes.foreground import await_ends, echo, woken_by_signals
from midastouch_tools.processes.process import Program
from midastouch_tools.processes.supervisor import BackOff, Supervisor

from .events.process import ProcessExited


class LaunchService:
    """Carries out what is included. A signal to stop ends it, and so does an error in an action or on an exit; a second
    signal cuts short the time that the processes have to end."""

    def __init__(self, *, argv: Iterable[str] = (), noninteractive: bool = False):
        from . import LaunchContext

        self.context = LaunchContext(argv=list(argv))
        self.context.service = self
        self.folder = ""
        self._included: list = []
        self._supervisor = Supervisor(os.environ, echo())

    def include_launch_description(self, launch_description) -> None:
        """Take a description, or an action that includes one, to be carried out."""
        self._included.append(launch_description)

    def run(self, *, shutdown_when_idle: bool = True) -> int:
        """Carry it out until every process has ended or a signal comes; returns 1 after an error, otherwise 0."""
        supervisor = self._supervisor
        with woken_by_signals() as wait, temporary_folder("launch") as self.folder:
            try:
                self.visit(self._included)
                while (due := supervisor.look_after()) is not None or supervisor.busy:
                    if self.context.is_shutdown or wait(due):
                        supervisor.say("ending all")
                        break
            except Exception as error:  # of any kind: launch files are anybody's
                supervisor.say(str(error.args[0] if isinstance(error, KeyError) else error))  # whose text has quotes
                return 1
            finally:
                self.context.is_shutdown = True
                supervisor.end(lambda left, seconds: await_ends(wait, left, seconds))
        return 0

    def visit(self, entities: object) -> None:
        """Visit an action, or several, and what they return, depth first."""
        for entity in entities if isinstance(entities, list | tuple) else filter(None, [entities]):
            self.visit(entity.visit(self.context))

    def start(self, action, name: str, command: list[str]) -> None:
        """Start the process of an action, which has `on_exit`, `respawn` and `respawn_delay`."""

        def ended(pid: int, status: int) -> bool:
            handler = action.on_exit
            self.visit(handler(ProcessExited(name, pid, status), self.context) if callable(handler) else handler)
            return self.context.is_shutdown

        back_off = BackOff(first=action.respawn_delay) if action.respawn else None
        self._supervisor.start(Program(name, tuple(command)), back_off, ended)
