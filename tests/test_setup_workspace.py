"""The set-up never trusts what it has not finished, and does nothing twice."""

import fcntl
import os
import signal
import subprocess
import sys
import venv

import pytest


@pytest.fixture
def workspace(load_tool, tmp_path, monkeypatch):
    """The set-up script on an empty folder; its steps only note that they ran."""
    tool = load_tool("setup_workspace")
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    monkeypatch.setattr(tool, "VENV", tmp_path / ".venv")
    monkeypatch.setattr(tool, "PYTHON", tmp_path / ".venv" / "bin" / "python")
    monkeypatch.setattr(tool, "STAMPS", tmp_path / ".venv" / ".setup")
    monkeypatch.setattr(tool, "RUNNING", tmp_path / ".venv" / ".setup" / "running")
    monkeypatch.setattr(tool, "LOG", tmp_path / ".venv" / "setup.log")
    monkeypatch.setattr(tool, "LOCK", tmp_path / "lock.txt")
    monkeypatch.setattr(tool, "FIX_EXPORTS", tmp_path / "fix.py")
    monkeypatch.setattr(tool, "INTERFACES", [tmp_path / "msgs"])
    monkeypatch.setattr(tool, "KERNELS", tmp_path / "kernels")
    monkeypatch.setattr(tool, "PACKAGES", [tmp_path / "package"])
    (tmp_path / "lock.txt").write_text("numpy==1\n")
    (tmp_path / "fix.py").touch()
    (tmp_path / "msgs").mkdir()
    (tmp_path / "msgs" / "A.msg").write_text("bool a\n")
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "a.cpp").touch()
    (tmp_path / "package").mkdir()
    for name in ("setup.py", "setup.cfg", "package.xml"):
        (tmp_path / "package" / name).touch()
    tool.ran = []

    def step(name):
        def action(progress):
            tool.ran.append(name)
            if name == "environment":
                tool.PYTHON.parent.mkdir(parents=True)
                tool.PYTHON.touch()

        return action

    monkeypatch.setattr(tool, "make_environment", step("environment"))
    monkeypatch.setattr(tool, "install_dependencies", step("dependencies"))
    monkeypatch.setattr(tool, "build_interfaces", step("interfaces"))
    monkeypatch.setattr(tool, "build_kernels", step("kernels"))
    monkeypatch.setattr(tool, "install_packages", step("packages"))
    return tool


ALL = ["environment", "dependencies", "interfaces", "kernels", "packages"]


def again(tool) -> list[str]:
    """Run the set-up; the steps it took."""
    tool.ran.clear()
    tool.set_up(lock=None)
    return list(tool.ran)


def test_second_call_does_nothing(workspace, capsys):
    assert again(workspace) == ALL
    capsys.readouterr()
    assert again(workspace) == []
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("changed", "steps"),
    [
        ("lock.txt", ["dependencies", "interfaces", "kernels", "packages"]),
        ("msgs/A.msg", ["interfaces"]),
        ("kernels/a.cpp", ["kernels"]),
        ("package/setup.py", ["packages"]),
    ],
)
def test_a_change_repeats_what_depends_on_it(workspace, changed, steps):
    again(workspace)
    (workspace.ROOT / changed).write_text("changed")
    assert again(workspace) == steps


def test_renaming_a_message_is_a_change(workspace):
    again(workspace)
    (workspace.ROOT / "msgs" / "A.msg").rename(workspace.ROOT / "msgs" / "B.msg")
    assert again(workspace) == ["interfaces"]


@pytest.mark.parametrize("step", ["make_environment", "install_dependencies"])
def test_interrupted_installation_starts_anew(workspace, monkeypatch, step):
    with monkeypatch.context() as patch:

        def interrupted(progress):
            raise KeyboardInterrupt

        patch.setattr(workspace, step, interrupted)
        with pytest.raises(KeyboardInterrupt):
            again(workspace)
    (workspace.VENV / "half a package").touch()
    assert again(workspace) == ALL
    assert not (workspace.VENV / "half a package").exists()


def test_interrupted_build_goes_on_where_it_was(workspace, monkeypatch):
    with monkeypatch.context() as patch:

        def fails(progress):
            raise workspace.SetupError("no compiler")

        patch.setattr(workspace, "build_interfaces", fails)
        with pytest.raises(workspace.SetupError):
            again(workspace)
    assert again(workspace) == ["interfaces", "kernels", "packages"]


def test_moved_environment_is_made_anew(workspace, monkeypatch):
    again(workspace)
    (workspace.STAMPS / "environment").write_text("key of another folder")
    assert again(workspace) == ALL


def test_environment_of_someone_else_is_left_alone(workspace):
    workspace.VENV.mkdir()
    (workspace.VENV / "theirs").touch()
    with pytest.raises(workspace.SetupError, match="not made by this set-up"):
        again(workspace)
    assert (workspace.VENV / "theirs").exists()


def test_unsupported_python_is_named(load_tool, monkeypatch):
    tool = load_tool("setup_workspace")
    monkeypatch.setattr(tool.sys, "version_info", (3, 9, 1))
    with pytest.raises(tool.SetupError, match=r"3\.10 to 3\.13"):
        tool.check_machine()


def test_missing_cmake_is_named(load_tool, monkeypatch):
    tool = load_tool("setup_workspace")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(tool.SetupError, match="apt install cmake"):
        tool.check_machine()


def test_the_environment_s_own_python_hands_over_to_the_one_it_was_made_from(root, tmp_path):
    venv.create(tmp_path / ".venv", symlinks=True)
    script = tmp_path / "called.py"
    script.write_text(f"""
import pathlib, sys
sys.path.insert(0, {str(root / "tools")!r})
sys.dont_write_bytecode = True
import setup_workspace as tool
tool.VENV = pathlib.Path({str(tmp_path / ".venv")!r})
tool.leave_environment()
print(sys.prefix, *sys.argv[1:])
""")
    command = [tmp_path / ".venv" / "bin" / "python", script, "an argument"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said == f"{sys.base_prefix} an argument\n"


def test_failing_command_shows_its_end_and_the_mend(workspace, tmp_path):
    workspace.VENV.mkdir()
    with (tmp_path / "lock").open("w") as lock:
        progress = workspace.Progress("step", lock)
        command = [sys.executable, "-c", "print('early'); [print('line', i) for i in range(40)]; exit(3)"]
        with pytest.raises(workspace.SetupError) as error:
            workspace.run(command, progress, "Mend it so.")
    assert "line 39" in str(error.value)
    assert "early" not in str(error.value)
    assert str(error.value).endswith("Mend it so.")
    assert "early" in workspace.LOG.read_text()


def test_a_killed_set_up_keeps_others_out_until_its_command_ends(root, tmp_path):
    """The lock is inherited by the command, so nobody works on the same files beside an orphan."""
    code = f"""
import fcntl, sys, pathlib
sys.path.insert(0, {str(root / "tools")!r})
sys.dont_write_bytecode = True
import setup_workspace as tool
tool.LOG = pathlib.Path({str(tmp_path / "log")!r})
with open({str(tmp_path / "lock")!r}, "w") as lock:
    fcntl.flock(lock, fcntl.LOCK_EX)
    child = "import sys; print('up', flush=True); sys.stdin.close(); open({str(tmp_path / "fifo")!r}).read()"
    tool.run([sys.executable, "-c", child], tool.Progress("step", lock), "")
"""
    os.mkfifo(tmp_path / "fifo")
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL)
    # Opening a FIFO for writing waits until the command has opened it for reading.
    with (tmp_path / "fifo").open("w"):
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        with (tmp_path / "lock").open() as lock, pytest.raises(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    with (tmp_path / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
