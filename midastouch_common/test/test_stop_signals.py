"""What a process does with the signals that ask it to end, moment by moment."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from midastouch_common.stop_signals import sparing_children

PROGRAM = """
import contextlib, os, sys
from midastouch_common.stop_signals import Stopped, end_at_once, interruptible, stop_event

def say(text):  # in one piece, whatever another thread says
    os.write(1, f"{text}\\n".encode())

def stay(moment):
    say(moment)
    sys.stdin.readline()

def work(name):
    with contextlib.suppress(Stopped), interruptible():
        try:
            say(name)
            while name:
                pass
        except Stopped:
            if "importing" in sys.argv:
                raise ImportError  # as a library in C does
            raise
        finally:
            stay("cleaning up")

end_at_once()
stay("loading")
with stop_event(lambda: say("woken")) as stopping:
    if "work" in sys.argv:
        work("working")
        work("never begun")
    stay("making")
    stopping.wait()
    stay("ending")
stay("ended")
sys.exit(3)
"""
STOP = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


class Run:
    """The program; it goes on from moment to moment when it is let."""

    def __init__(self, *prefix: str, options: tuple[str, ...] = ()) -> None:
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        self._process = subprocess.Popen([*prefix, sys.executable, "-c", PROGRAM, *options], text=True, **pipes)
        self.until("loading")

    def until(self, said: str) -> None:
        assert self._process.stdout.readline() == f"{said}\n"

    def until_all(self, *said: str) -> None:
        """In any order."""
        assert sorted(self._process.stdout.readline().strip() for _ in said) == sorted(said)

    def send(self, number: int) -> None:
        self._process.send_signal(number)

    def go_on(self, to: str = "") -> None:
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        if to:
            self.until(to)

    def end(self) -> tuple[int, str]:
        """Exit code and stderr."""
        errors = self._process.communicate()[1]
        return self._process.returncode, errors

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


@pytest.fixture
def run():
    """Starts the program, behind a prefix of its command line."""
    runs = []

    def start(*prefix: str, **options) -> Run:
        runs.append(Run("env", "--default-signal=INT,HUP", *prefix, **options))
        return runs[-1]

    yield start
    for item in runs:
        item.kill()


@pytest.mark.parametrize("number", STOP)
def test_with_nothing_to_leave_in_order_it_ends_at_once(run, number) -> None:
    it = run()
    it.send(number)
    assert it.end() == (0, "")


@pytest.mark.parametrize("number", STOP)
def test_a_signal_is_an_event_once_and_nothing_ever_after(run, number) -> None:
    it = run()
    it.go_on("making")
    it.send(number)
    it.until("woken")
    it.go_on("ending")
    it.send(number)
    it.until("woken")
    it.go_on("ended")
    it.send(number)
    it.go_on()
    assert it.end() == (3, "")


@pytest.mark.parametrize(("ignored", "number"), [("HUP", signal.SIGHUP), ("INT", signal.SIGINT)])
def test_only_a_hang_up_stays_ignored(run, ignored, number) -> None:
    it = run("env", f"--ignore-signal={ignored}")
    it.go_on("making")
    it.send(number)
    if number == signal.SIGHUP:
        it.send(signal.SIGTERM)
    it.until("woken")
    it.go_on("ending")  # not woken twice
    it.go_on("ended")
    it.go_on()
    assert it.end() == (3, "")


@pytest.mark.parametrize("options", [("work",), ("work", "importing")])
@pytest.mark.parametrize("number", STOP)
def test_a_signal_breaks_off_work_but_not_its_clean_up(run, number, options) -> None:
    it = run(options=options)
    it.go_on("working")
    it.send(number)
    it.until_all("woken", "cleaning up")
    it.send(number)
    it.until("woken")
    it.go_on("making")  # work that is to begin after the signal does not
    it.go_on("ending")
    it.go_on("ended")
    it.go_on()
    assert it.end() == (3, "")


def test_processes_that_are_started_spared_never_hear_ctrl_c():
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    with sparing_children():
        spared = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert spared == "True\n"
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
