"""Real processes of a launch, in a process of its own; the programs are lines of shell."""

import importlib
import itertools
import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from patience import FOR_EVER, PATIENCE, wait_for

from midastouch_tools.processes.foreground import (
    ended_by_signals,
    exit_status,
    handlers_kept,
    interrupted_by_signals,
    woken_by_signals,
)

SUPERVISE = """
import json, os, sys
from pathlib import Path
from launch import LaunchDescription, LaunchService
from launch.actions import Shutdown
from launch_ros.actions import Node
from midastouch_tools.processes import process

task = json.loads(sys.argv[1])
process.GRACE_S = task["grace"]
process.LAST_OUTPUT_S = 60.0  # whatever the machine is busy with, last words are waited for
prefix = Path(task["prefix"])
(prefix / "share/ament_index/resource_index/packages").mkdir(parents=True)
(prefix / "share/ament_index/resource_index/packages/programs").touch()
(prefix / "lib/programs").mkdir(parents=True)
os.environ["AMENT_PREFIX_PATH"] = str(prefix)
respawn = task["back_off"] is not None


def ended(event, context):  # as in our launch files
    if not context.is_shutdown and (event.returncode == 2 or not respawn):
        raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")


def played(event, context):
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f"{event.process_name} died with exit code {event.returncode}: ending all")
    return Shutdown() if event.process_name == "last" else None


def node(name, line):
    script = prefix / "lib/programs" / name
    script.write_text("#!/bin/sh\\n" + line + "\\n")
    script.chmod(0o755)
    if name in task["ends"]:
        return Node(package="programs", executable=name, on_exit=played)
    return Node(package="programs", executable=name, respawn=respawn, respawn_delay=task["back_off"], on_exit=ended)


service = LaunchService()
service.include_launch_description(LaunchDescription([node(*each) for each in task["programs"].items()]))
sys.exit(service.run())
"""


class Supervised:
    """A launch at work, and the lines it has printed. Nodes are started again after `back_off` s, if that is given."""

    def __init__(self, prefix, programs, back_off=None, ends=(), grace=(PATIENCE,) * 3, before="", reads=None):
        task = {"programs": programs, "back_off": back_off, "ends": list(ends), "grace": grace}
        task = json.dumps({**task, "prefix": str(prefix)})
        command = ["sh", "-c", f'{before} exec "$@"', "sh", sys.executable, "-c", SUPERVISE, task]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.lines = []
        self._reader = threading.Thread(target=self._read, args=[reads], daemon=True)
        self._reader.start()

    def _read(self, most):
        with self.process.stdout:
            for line in itertools.islice(self.process.stdout, most):
                self.lines.append(line.rstrip("\n"))

    def until(self, condition):
        wait_for(condition, f"it; printed: {self.lines}")

    def said(self, line, times=1):
        self.until(lambda: self.lines.count(line) >= times)

    def status(self):
        status = self.process.wait(PATIENCE)
        self._reader.join()
        return status


@pytest.fixture
def supervise(signals_are_heard, tmp_path):
    made = []

    def make(*args, **options):
        made.append(Supervised(tmp_path / "prefix", *args, **options))
        return made[-1]

    yield make
    for one in made:
        one.process.kill()
        one.process.wait()


def running(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_output_is_told_apart_and_all_that_end_well_end_the_run(supervise):
    programs = {"a": "echo one; echo two >&2", "b": "printf 'no newline'"}
    run = supervise(programs, ends=["a", "b"])
    assert run.status() == 0
    said = [line for line in run.lines if line.startswith("[a]")]
    assert said == ["[a] one", "[a] two"]
    assert "[b] no newline" in run.lines
    assert run.lines.index("[a] two") < run.lines.index("[midastouch] a has finished; Ctrl-C ends the others")


def test_what_shuts_the_launch_down_ends_the_others_well(supervise, tmp_path):
    os.mkfifo(tmp_path / "ready")
    other = f"trap 'echo bye; exit 0' INT; echo ready > {tmp_path}/ready; {FOR_EVER}"
    run = supervise({"last": f"read -r _ < {tmp_path}/ready", "other": other}, ends=["last"])
    assert run.status() == 0
    assert run.lines == ["[midastouch] ending all", "[other] bye"]


@pytest.mark.parametrize(("end", "code"), [("exit 3", 3), ("exit 0", 0), ("kill -9 $$", -9)])
def test_a_death_is_reported_and_ends_the_others(supervise, tmp_path, end, code):
    """They would be of no use, and wait for it for ever."""
    os.mkfifo(tmp_path / "ready")
    mortal = f"read -r _ < {tmp_path}/ready; {end}"
    other = f"trap 'echo bye; exit 0' INT; echo ready > {tmp_path}/ready; {FOR_EVER}"
    run = supervise({"mortal": mortal, "other": other})
    assert run.status() == 1
    assert f"[midastouch] mortal died with exit code {code}: ending all" in run.lines
    assert "[other] bye" in run.lines


def test_what_dies_is_started_again_later_each_time(supervise):
    run = supervise({"mortal": "echo alive; exit 3", "other": f"echo alive; {FOR_EVER}"}, back_off=0.02)
    run.said("[mortal] alive", times=5)
    run.process.send_signal(signal.SIGINT)
    assert run.status() == 0
    pauses = [line.split(" in ")[1] for line in run.lines if "starting it again" in line]
    assert pauses[:4] == ["0.02 s", "0.04 s", "0.08 s", "0.16 s"]
    assert run.lines.count("[other] alive") == 1


def test_what_bad_input_ends_is_not_started_again(supervise):
    run = supervise({"filter": "echo no codebook; exit 2", "other": f"{FOR_EVER}"}, back_off=0.0)
    assert run.status() == 1
    assert run.lines.count("[filter] no codebook") == 1
    assert "[midastouch] filter died with exit code 2: ending all" in run.lines


def test_what_ends_by_itself_is_not_started_again(supervise):
    run = supervise({"replay": "echo played", "other": FOR_EVER}, back_off=0.0, ends=["replay"])
    run.said("[midastouch] replay has finished; Ctrl-C ends the others")
    run.process.send_signal(signal.SIGINT)
    assert run.status() == 0
    assert run.lines.count("[replay] played") == 1


def test_what_should_end_by_itself_and_fails_ends_the_others(supervise):
    run = supervise({"replay": "exit 2", "other": FOR_EVER}, back_off=0.0, ends=["replay"])
    assert run.status() == 1
    assert run.lines.count("[midastouch] replay died with exit code 2: ending all") == 1


@pytest.mark.parametrize(
    ("number", "before"),
    [
        (signal.SIGINT, ""),
        (signal.SIGTERM, ""),
        (signal.SIGHUP, ""),
        (signal.SIGQUIT, ""),
        (signal.SIGINT, "trap '' INT;"),  # as in the background of a shell without job control
    ],
)
def test_a_signal_ends_all_of_them_softly_at_first(supervise, number, before):
    programs = {
        "polite": f"trap 'echo bye; exit 0' INT; echo $$; {FOR_EVER}",
        "reluctant": f"trap '' INT; trap 'echo bye; exit 0' TERM; echo $$; {FOR_EVER}",
        "deaf": f"trap '' INT TERM; echo $$; {FOR_EVER}",
    }
    run = supervise(programs, before=before)
    run.until(lambda: len(run.lines) == 3)
    pids = dict(line.strip("[").split("] ") for line in run.lines)
    for name in ("polite", "reluctant"):
        run.process.send_signal(number)
        run.said(f"[{name}] bye")
        # or the next signal ends it before its `exit`
        run.until(lambda name=name: not running(int(pids[name])))
    run.process.send_signal(number)
    assert run.status() == 0
    assert run.lines[3:] == [
        "[midastouch] ending all", "[polite] bye", "[reluctant] bye", "[midastouch] deaf: killed by SIGKILL"
    ]  # fmt: skip
    assert not running(int(pids["deaf"]))


def test_who_does_not_go_in_time_is_killed(supervise):
    run = supervise({"deaf": f"trap '' INT TERM; echo ready; {FOR_EVER}"}, grace=(0.05, 0.05, PATIENCE))
    run.said("[deaf] ready")
    run.process.send_signal(signal.SIGINT)
    assert run.status() == 0
    assert run.lines[-1] == "[midastouch] deaf: killed by SIGKILL"


def test_who_presses_again_waits_no_longer(supervise):
    run = supervise({"deaf": f"trap '' INT; trap 'echo no' TERM; echo ready; {FOR_EVER}"}, grace=(PATIENCE,) * 3)
    run.said("[deaf] ready")
    for answer in ("[midastouch] ending all", "[deaf] no"):
        run.process.send_signal(signal.SIGINT)
        run.said(answer)
    run.process.send_signal(signal.SIGINT)
    assert run.status() == 0
    assert run.lines[-1] == "[midastouch] deaf: killed by SIGKILL"


def test_who_is_killed_takes_its_programs_along(supervise):
    run = supervise(dict.fromkeys(("one", "other"), f"trap 'exit 0' TERM; echo $$; {FOR_EVER}"))
    run.until(lambda: len(run.lines) == 2)
    pids = [int(line.split()[1]) for line in run.lines]
    run.process.kill()
    run.process.wait()
    run.until(lambda: not any(running(pid) for pid in pids))


def test_programs_outlive_who_reads_their_output(supervise, tmp_path):
    sign = tmp_path / "sign"
    lines = f"echo ready; while [ ! -e {sign} ]; do sleep 0.05; done; echo late; echo later; touch {sign}.seen"
    run = supervise({"a": lines}, reads=1)
    run.until(lambda: run.process.stdout.closed)
    sign.touch()
    run.until(lambda: Path(f"{sign}.seen").exists())
    assert run.status() == 1  # it died where it should have gone on


def test_what_our_output_cannot_hold_ends_nothing(supervise):
    # two lines: after the first nobody would read the second
    lines = "printf '\\342\\234\\223 ready\\n'; echo more; exit 3"
    run = supervise({"a": lines}, before="PYTHONIOENCODING=ascii; export PYTHONIOENCODING;")
    assert run.status() == 1
    assert run.lines == ["[a] ? ready", "[a] more", "[midastouch] a died with exit code 3: ending all"]


def test_no_signal_is_lost_between_two_steps_of_listening(monkeypatch):
    """As soon as SIGINT does nothing by itself, `wait` knows of it."""
    set_handler = signal.signal

    def interrupted(number, handler):
        former = set_handler(number, handler)
        if number == signal.SIGINT and handler is not former and not raised:
            raised.append(number)
            signal.raise_signal(number)
        return former

    raised = []
    monkeypatch.setattr(signal, "signal", interrupted)
    with woken_by_signals() as wait:
        assert raised
        assert wait(0.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_every_signal_to_stop_interrupts_work(number, signals_are_heard):
    former = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in the background of a shell without job control
    try:
        with pytest.raises(KeyboardInterrupt) as interrupt, interrupted_by_signals():
            signal.raise_signal(number)
        assert exit_status(interrupt.value) == 128 + number
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        with pytest.raises(SystemExit, match=f"{128 + number}"), ended_by_signals():
            signal.raise_signal(number)
    finally:
        signal.signal(signal.SIGINT, former)


@pytest.mark.parametrize(
    ("listening", "until_it_is_closed"),
    [("interrupted_by_signals()", "time.sleep(60.0)"), ("woken_by_signals() as wait", "assert wait(60.0)")],
)
def test_who_closes_the_terminal_ends_no_last_words(listening, until_it_is_closed, tmp_path):
    work = f"""
import pathlib, time
from midastouch_tools.processes import foreground
from midastouch_tools.replay.keyboard import Keyboard
try:
    with foreground.{listening}, Keyboard({{}}):
        print("working", flush=True)
        {until_it_is_closed}
except KeyboardInterrupt:
    pass
print("last words", flush=True)
pathlib.Path("done").touch()
"""
    run, terminal = pty.fork()
    if run == 0:
        os.chdir(tmp_path)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored
        os.execv(sys.executable, [sys.executable, "-c", work])
    said = ""
    while "working" not in said:
        said += os.read(terminal, 1024).decode()
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(run, 0)[1]) == 0
    assert (tmp_path / "done").exists()


def test_an_import_that_swallows_what_a_signal_raises_does_not_swallow_the_signal(tmp_path, monkeypatch):
    module = "import signal\ntry:\n    signal.raise_signal(signal.SIGINT)\nexcept BaseException:\n    pass\n"
    (tmp_path / "swallowing.py").write_text(module)
    monkeypatch.syspath_prepend(str(tmp_path))

    def work():
        assert importlib.import_module("swallowing")
        time.sleep(30.0)  # bounds a failing test only

    with pytest.raises(KeyboardInterrupt), interrupted_by_signals():
        work()


def test_a_signal_while_an_object_is_deleted_comes_after_that():
    class Dying:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def work():
        Dying()
        time.sleep(30.0)  # bounds a failing test only

    with pytest.raises(KeyboardInterrupt), interrupted_by_signals():
        work()


def test_handlers_of_nodes_stay_unless_there_is_more_to_do(signals_are_heard):
    former = signal.getsignal(signal.SIGTERM)
    try:
        with interrupted_by_signals():
            heard = signal.getsignal(signal.SIGTERM)
            with handlers_kept():
                signal.signal(signal.SIGTERM, signal.SIG_IGN)
            assert signal.getsignal(signal.SIGTERM) is heard
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, former)
