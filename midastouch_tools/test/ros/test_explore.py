"""An exploration at a small size: real nodes as processes, over DDS."""

import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
from pathlib import Path
from unittest.mock import Mock

import pytest
import yaml
from patience import wait_for
from PIL import Image

from midastouch_tools import cli
from midastouch_tools.drawing import run_pictures
from midastouch_tools.ros import explore

pytestmark = [pytest.mark.dds, pytest.mark.slow]
MAX_PATH, MAX_MOTION = 0.01, 0.02  # m


@pytest.fixture
def short(tmp_path, monkeypatch):
    """A short way and a small codebook, in a folder of its own; the words for the command."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "keys").touch()
    monkeypatch.setattr("sys.stdin", (tmp_path / "keys").open())  # no terminal; that of the tests is not to be read
    monkeypatch.setattr(run_pictures, "GIF_FRAMES", 3)
    assert cli.main(["build-codebook", "eyebolt", "--size", "400"]) == 0
    overlay = {"explorer": {"ros__parameters": {"max_path": MAX_PATH, "max_motion": MAX_MOTION}}}
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(overlay))
    return ["object:=eyebolt", "codebook:=out/codebooks/eyebolt.npz", "objects:=", "params_overlay:=short.yaml"]


@pytest.mark.parametrize("arm", ["finger", "mujoco"])
def test_it_moves_feels_and_leaves_a_page_however_it_ends(short, tmp_path, capsys, arm):
    if arm == "mujoco":
        pytest.importorskip("mujoco", reason="not installed: tools/requirements/mujoco.txt")
    code = cli.main(["run", "explore", f"arm:={arm}", *short])
    output = capsys.readouterr().out
    out = tmp_path / "out" / "explore"
    result = json.loads((out / "result.json").read_text())
    assert (result["object"], result["answer"], result["object_probability"]) == ("eyebolt", "eyebolt", 1.0)
    assert result["frames"] > 5
    for name in ("run.png", "final.png", "run.gif"):
        with Image.open(out / name) as picture:
            assert picture.width > 300
        assert name in (out / "index.html").read_text()
    if result["ended"] == "known":  # leaps, which count as no way, differ with the machine
        assert code == (0 if result["right"] else 1)
        return
    assert code == 1  # so short a way tells nobody where it is
    assert (result["ended"], result["right"], result["by_hand"]) == ("gave_up", False, False)
    assert f"gave_up: {result['reason']}" in " ".join(output.split())  # which is wrapped
    # it may give up before the way is spent, as leaps are none; the motion that spends it is ended, on uneven ground
    assert (result["path_m"] > 0) == (result["slides"] > 0)
    assert result["path_m"] > MAX_PATH or not result["reason"].startswith("still")
    assert result["path_m"] < MAX_PATH + 1.5 * MAX_MOTION
    assert result["lifts"] >= 1, result["reason"]


@pytest.mark.parametrize("step", ["read_run", "write_page"])
def test_it_begins_with_a_catalogue_and_is_kept_without_pictures(short, tmp_path, monkeypatch, step):
    """The filter has no pose before the first touch, and Ctrl-C comes while the result is made."""
    monkeypatch.setattr(explore, step, Mock(side_effect=KeyboardInterrupt))
    assert cli.main(["build-codebook", "ball", "--size", "400"]) == 0
    words = ["objects:=out/codebooks/ball.npz" if word == "objects:=" else word for word in short]
    cli.main(["run", "explore", *words])
    result = json.loads((tmp_path / "out" / "explore" / "result.json").read_text())
    assert result["slides"] + result["lifts"] > 0
    assert (tmp_path / "out" / "explore" / "run.mcap").is_file()
    assert ("answer" in result) == (step == "write_page")
    assert "was interrupted" in (tmp_path / "out" / "explore" / "index.html").read_text()


@pytest.mark.parametrize("end", ["q", "\x03", ""], ids=["q", "Ctrl-C", "closed terminal"])
def test_a_person_at_the_keyboard_pushes_the_object_and_ends_it(short, tmp_path, end):
    run, terminal = pty.fork()
    if run == 0:  # in a terminal of its own, 150 columns wide
        fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 150, 0, 0))
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored
        os.execv(sys.executable, [sys.executable, "-m", "midastouch_tools.cli", "run", "explore", *short[:3]])
    shown, keys = "", [("exploring", "eyebolt", " "), ("paused", "a person has the finger", "p")]
    keys.append(("paused", "a person has pushed the object", end))
    while True:
        try:
            shown += os.read(terminal, 4096).decode(errors="replace")
        except OSError:  # the run has ended
            break
        if keys and re.search(rf"{keys[0][0]}, \d+ mm, \d+ s \| {keys[0][1]} \| .*best pose", shown):
            if not (key := keys.pop(0)[2]):
                os.close(terminal)
                break
            os.write(terminal, key.encode())
    assert os.waitstatus_to_exitcode(os.waitpid(run, 0)[1]) == 0, shown
    assert "p: push the object" in shown
    result = json.loads((tmp_path / "out" / "explore" / "result.json").read_text())
    assert result["by_hand"]
    assert "ended by hand" in (tmp_path / "out" / "explore" / "index.html").read_text()
    assert (tmp_path / "out" / "explore" / "run.mcap").is_file()


def state_and_parent(pid: int) -> tuple[str, int]:
    """Of a process: its state, as of proc(5), X once it is gone, and who has started it."""
    try:
        state, parent = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:2]
    except OSError:
        return "X", 0
    return state, int(parent)


def children(parent: int) -> list[int]:
    """Those that have not ended: one that has is there until its parent asks for its exit code."""
    pids = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    of = {pid: state_and_parent(pid) for pid in pids}
    return [pid for pid, (state, its_parent) in of.items() if its_parent == parent and state != "Z"]


def command_line(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text()


def test_a_second_ctrl_c_waits_for_no_node(short, tmp_path, monkeypatch):
    """The filter does not go. It is none that is stopped by SIGSTOP: it may hold a lock in Fast DDS's memory, and then
    all the others hang, too."""
    (index := tmp_path / "install/share/ament_index/resource_index/packages").mkdir(parents=True)
    (index / "midastouch_filter").touch()
    stubborn = tmp_path / "install/lib/midastouch_filter/particle_filter"
    stubborn.parent.mkdir(parents=True)
    stubborn.write_text('#!/bin/sh\ntrap "" INT TERM\nexec sleep 600\n')
    stubborn.chmod(0o755)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"), prepend=os.pathsep)
    command = [sys.executable, "-m", "midastouch_tools.cli", "run", "explore", *short[:3]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        for one in ("sleep", "explorer"):  # the explorer is started last
            wait_for(lambda one=one: any(one in command_line(pid) for pid in children(run.pid)), one)
        (held,) = [pid for pid in children(run.pid) if "sleep" in command_line(pid)]
        run.send_signal(signal.SIGINT)
        wait_for(lambda: children(run.pid) == [held], "the end of the other nodes")
        run.send_signal(signal.SIGINT)
        assert list(run.stdout)[-1] == "midastouch: interrupted\n"
    assert run.returncode == 128 + signal.SIGINT
    wait_for(lambda: state_and_parent(held)[0] in "ZX", "the end of the filter, killed")
    assert [path.name for path in Path("out/explore").iterdir()] == [".lock"]


def test_a_node_that_dies_ends_it_and_the_page_says_so(short, tmp_path, capsys):
    (tmp_path / "broken.npz").write_bytes(b"no codebook")
    words = [word.replace("out/codebooks/eyebolt.npz", "broken.npz") for word in short]
    assert cli.main(["run", "explore", *words]) == 1
    error = capsys.readouterr().err
    assert "particle_filter died" in error
    assert "broken.npz" in error
    page = (tmp_path / "out" / "explore" / "index.html").read_text()
    assert "failed: particle_filter died" in page
    assert "nothing to draw" in page
