"""Key presses through a terminal of our own."""

import os
import pty
import signal
import subprocess
import sys
import termios
import time

import pytest

from midastouch_tools.replay.keyboard import Keyboard

PROGRAM = """
import sys, time
from midastouch_tools.replay.keyboard import Keyboard
stop = []
keys = {" ": lambda: print("space", flush=True), "left": lambda: print("left", flush=True), "q": lambda: stop.append(1)}
with Keyboard(keys) as keyboard:
    print("active" if keyboard.active else "idle", flush=True)
    while keyboard.active and not stop:
        time.sleep(0.01)
print("end", flush=True)
"""


class Terminal:
    """A program in a terminal of its own; `say` types, `told` is what it printed; `before`, the terminal's attributes
    before it began."""

    def __init__(self):
        self.pid, self.file = pty.fork()
        if self.pid == 0:
            os.read(0, 1)  # a line: begin
            # what runs in the background of a shell has it ignored, and a program inherits that
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.execv(sys.executable, [sys.executable, "-c", PROGRAM])
        self.before = termios.tcgetattr(self.file)
        self.told = ""
        self.say("\n")

    def until(self, text: str) -> None:
        deadline = time.monotonic() + 60
        while text not in self.told:
            assert time.monotonic() < deadline, self.told
            try:
                self.told += os.read(self.file, 1000).decode()
            except OSError:  # it has ended
                assert text in self.told
                return

    def say(self, text: str) -> None:
        os.write(self.file, text.encode())


@pytest.fixture
def terminal():
    running = Terminal()
    yield running
    try:
        os.kill(running.pid, signal.SIGKILL)
        os.waitpid(running.pid, 0)
    except (ProcessLookupError, ChildProcessError):
        pass
    os.close(running.file)


def test_keys_need_no_enter_and_the_terminal_is_restored(terminal):
    terminal.until("active")
    terminal.say(" ")
    terminal.until("space")
    terminal.say("x\x1b[D")  # one that means nothing, and an arrow in one piece with it
    terminal.until("left")
    terminal.say("  ")
    terminal.until("space\r\nspace\r\n")
    terminal.say("q")
    terminal.until("end")
    assert termios.tcgetattr(terminal.file)[3] == terminal.before[3]


def test_ctrl_c_interrupts(terminal):
    terminal.until("active")
    terminal.say("\x03")
    terminal.until("KeyboardInterrupt")


def test_without_a_terminal_nothing_happens():
    done = subprocess.run([sys.executable, "-c", PROGRAM], input="q", capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["idle", "end"]
    read, write = os.pipe()
    with Keyboard({}, read) as keyboard:
        assert not keyboard.active
    os.close(read)
    os.close(write)
    closed = subprocess.run(
        f"{sys.executable} -c '{PROGRAM}' <&-", shell=True, capture_output=True, text=True, timeout=60
    )
    assert closed.stdout.split() == ["idle", "end"]
