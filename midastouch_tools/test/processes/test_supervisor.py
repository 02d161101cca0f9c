"""Processes are started, looked after and ended; the stand-ins are lines of shell."""

import errno
import os
import re
import signal
import subprocess

import pytest
from patience import FOR_EVER, PATIENCE, wait_for

from midastouch_tools.processes import process
from midastouch_tools.processes.local_domain import LogFolder
from midastouch_tools.processes.process import Program
from midastouch_tools.processes.supervisor import BackOff, NodeFailed, Supervisor


def shell(name: str, *lines: str, ends: bool = False) -> Program:
    return Program(name, ("sh", "-c", "\n".join(lines)), ends)


@pytest.fixture
def heard(monkeypatch) -> list[str]:
    """What was printed and said, as `NAME LINE`."""
    monkeypatch.setattr(process, "LAST_OUTPUT_S", PATIENCE)
    return []


@pytest.fixture
def supervisor(heard):
    with Supervisor(os.environ, lambda name, line: heard.append(f"{name} {line}")) as one:
        yield one


def looked_after(supervisor: Supervisor) -> bool:
    supervisor.look_after()
    return not supervisor.busy


def test_who_fails_is_reported_with_its_last_words(supervisor):
    supervisor.start(shell("h_fail", "seq 100", "echo no such mesh >&2", "exit 3"))
    with pytest.raises(NodeFailed, match=r"h_fail .*exit code 3") as caught:
        wait_for(lambda: looked_after(supervisor))
    assert caught.value.cause == "h_fail died: exit code 3"
    assert "\n  100\n  no such mesh" in str(caught.value)
    assert "\n  5\n" not in str(caught.value)


def test_only_what_is_meant_to_end_may_end_by_itself(supervisor, heard):
    supervisor.start(shell("h_done", "echo done", ends=True))
    wait_for(lambda: looked_after(supervisor))
    assert heard == ["h_done done", "midastouch h_done has finished; Ctrl-C ends the others"]
    supervisor.start(shell("h_early", "exit 0"))
    with pytest.raises(NodeFailed, match="h_early died: exit code 0"):
        wait_for(lambda: looked_after(supervisor))


@pytest.mark.parametrize(
    ("trap", "seconds"), [("trap 'echo bye; exit 0' INT", 600.0), ("trap 'echo bye; exit 0' TERM; trap '' INT", 0.05)]
)
def test_all_are_asked_before_they_are_killed(supervisor, heard, monkeypatch, trap, seconds):
    monkeypatch.setattr(process, "GRACE_S", (seconds, 600.0, 600.0))
    supervisor.start(shell("h_polite", trap, "echo ready", FOR_EVER))
    wait_for(lambda: heard)
    supervisor.end()
    assert heard == ["h_polite ready", "h_polite bye"]


def test_who_is_left_when_the_waiting_is_cut_short_is_killed(supervisor, heard):
    supervisor.start(shell("h_deaf", "trap '' INT TERM", "echo ready", FOR_EVER))
    wait_for(lambda: heard)
    (deaf,) = supervisor.pids.values()

    def cut_short(left, seconds):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        supervisor.end(cut_short)
    assert os.waitstatus_to_exitcode(os.waitpid(deaf, 0)[1]) == -signal.SIGKILL


def test_who_has_died_is_started_again_and_its_log_goes_on(tmp_path, heard):
    logs = LogFolder(tmp_path / "log")
    (tmp_path / "log" / "h_dead.log").write_text("of an earlier run\n")
    lives = tmp_path / "lives"
    dies_once = shell("h_dead", "echo one life", f"if mkdir {lives}; then exit 3; fi", FOR_EVER)
    with Supervisor(os.environ, logs) as supervisor:
        for program in (dies_once, shell("h_alive", FOR_EVER)):
            supervisor.start(program, BackOff(0.0, 0.0))
        before = supervisor.pids

        def lives_again() -> bool:
            supervisor.look_after()
            return supervisor.pids.get("h_dead", before["h_dead"]) != before["h_dead"]

        wait_for(lives_again)
        log = tmp_path / "log" / "h_dead.log"
        wait_for(lambda: [line for line in log.read_text().splitlines() if "life" in line] == ["one life"] * 2)
        assert supervisor.pids["h_alive"] == before["h_alive"]
    said = (tmp_path / "log" / "midastouch.log").read_text()
    assert re.fullmatch(r"h_dead .*exit code 3; .*0 s\n", said)


def test_the_pause_grows_to_a_limit_until_a_long_life_resets_it():
    back_off = BackOff(first=2.0, longest=10.0)
    assert [back_off.after(1.0) for _ in range(5)] == [2.0, 4.0, 8.0, 10.0, 10.0]
    assert back_off.after(10.0) == 2.0
    assert back_off.after(0.0) == 4.0


def test_what_cannot_be_started_again_now_is_tried_later(monkeypatch, supervisor, heard):
    start, calls = subprocess.Popen, []

    def short_of_memory(*args, **options):
        calls.append(args)
        if len(calls) == 2:
            raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
        return start(*args, **options)

    monkeypatch.setattr(subprocess, "Popen", short_of_memory)
    supervisor.start(shell("mortal", "exit 3"), BackOff(0.01, 600.0))
    wait_for(lambda: supervisor.look_after() is not None and len(calls) == 3)
    assert "midastouch mortal could not be started: Cannot allocate memory; trying again in 0.02 s" in heard
