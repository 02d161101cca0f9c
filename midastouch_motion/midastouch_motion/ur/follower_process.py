"""Parent's side of the program `ur_follower`, which is started, listened to, ended, and started again."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from .orders import ALIVE, READY, TROUBLE, Order

_CONNECTING = 20.0  # s, for the import of ur-rtde and its own timeouts
SILENT_S = 2.0  # s, longest silence of a program that has connected
_ENDING = 2.0  # s, for the arm to come to rest
PAUSE_S = 0.5  # s without an order, after which the next one begins a motion


class FollowerProcess:
    """Keeper of the program until `close`, with a thread of its own that listens to it.

    Attributes: trouble, why the arm is not connected at present, empty while it is; connections, number so far.

    Parameters
    ----------
    command
        The command line.
    pause : [s] before a program that has ended is started again
    on_change
        Called in that thread with the trouble when it changes.
    """

    def __init__(self, command: Sequence[str], pause: float, on_change: Callable[[str], None]):
        self.trouble, self.connections = "not connected yet", 0
        self._ordered, self._lost = -np.inf, False  # time of the last order; whether a part of its motion was lost
        self._command, self._pause, self._on_change = command, pause, on_change
        self._lock, self._closing = threading.Lock(), threading.Event()
        self._process: subprocess.Popen | None = None
        self._thread = threading.Thread(target=self._run, name="ur_follower", daemon=True)
        self._thread.start()

    @property
    def broken_off(self) -> bool:
        """True while orders continue of a motion of which a part was lost.

        The arm, which somebody may have stopped, only follows the next motion, after an order of zero or a pause.
        """
        return self._lost and time.monotonic() - self._ordered <= PAUSE_S

    def send(self, twist: np.ndarray) -> None:
        """Order a twist (6,) of the TCP along its own axes; it is lost while there is trouble."""
        order = Order(time.monotonic(), twist)
        begins, self._ordered = order.sent - self._ordered > PAUSE_S, order.sent
        with self._lock, contextlib.suppress(OSError):  # the program has ended, or does not read
            if self._process is None or self.trouble:
                self._lost = bool(twist.any())
            elif begins or not twist.any():
                self._lost = False
            if self._process is not None and not self._lost:
                os.write(self._process.stdin.fileno(), order.line())

    def close(self) -> None:
        """Stop the arm and end the program."""
        self._closing.set()
        with self._lock:
            if self._process is not None:
                self._process.stdin.close()
                if self.trouble:  # the program moves no arm
                    self._process.kill()
        self._thread.join(_ENDING)
        with self._lock:
            if self._process is not None:
                self._process.kill()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                # a session of its own: Ctrl-C is for the parent, which stops the arm first
                process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
                )
            except OSError as error:  # for example, no memory
                self._change(f"the process of ur-rtde does not start: {error}")
                self._closing.wait(self._pause)
                continue
            os.set_blocking(process.stdin.fileno(), False)
            with self._lock:
                self._process = process
                if self._closing.is_set():  # `close` was called since the program was started
                    process.kill()
            reason = self._listen(process.stdout.fileno())
            with self._lock:
                self._process = None
            process.kill()
            with process:  # closes its pipes, and waits for it
                pass
            if not self._closing.is_set():
                self._change(reason or f"ur-rtde has ended its process, exit code {process.returncode}")
            self._closing.wait(self._pause)

    def _listen(self, descriptor: int) -> str:
        """Listen until the program ends or is silent for too long; return the reason, empty if it gave none."""
        data, patient_until = b"", time.monotonic() + _CONNECTING
        while select.select([descriptor], [], [], max(patient_until - time.monotonic(), 0.0))[0]:
            received = os.read(descriptor, 65536)
            if not received:
                return ""
            *lines, data = (data + received).split(b"\n")
            for line in lines:
                word, _, text = line.decode(errors="replace").partition(" ")
                if word == TROUBLE:
                    return text
                if word == READY:
                    self.connections += 1
                    self._change("")
                if word in (READY, ALIVE):
                    patient_until = time.monotonic() + SILENT_S
        return "ur-rtde does not answer any more"

    def _change(self, trouble: str) -> None:
        if trouble != self.trouble:
            self.trouble = trouble
            self._on_change(trouble)
