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
    places = {
        "ROOT": tmp_path, "VENV": tmp_path / ".venv", "PYTHON": tmp_path / ".venv" / "bin" / "python",
        "STAMPS": tmp_path / ".venv" / ".setup", "LOGS": tmp_path / ".venv" / "setup", "LOCK": tmp_path / "lock.txt",
        "FIX_EXPORTS": tmp_path / "fix.py", "INTERFACES": [tmp_path / "msgs"], "PYTHON_ONLY": tmp_path / "only.cmake",
        "KERNELS": tmp_path / "kernels", "PACKAGES": [tmp_path / "package"], "SHIMS": [tmp_path / "tf2_ros"],
    }  # fmt: skip
    for name, place in places.items():
        monkeypatch.setattr(tool, name, place)
    of_package = ("package/setup.py", "package/setup.cfg", "package/package.xml")
    for name in (
        "lock.txt",
        "fix.py",
        "only.cmake",
        "msgs/A.msg",
        "tf2_ros/pyproject.toml",
        "kernels/a.cpp",
        *of_package,
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("numpy==1\n")
    tool.ran = []

    def step(name):
        def action():
            tool.ran.append(name)
            if name == "environment":
                tool.PYTHON.parent.mkdir(parents=True)
                tool.PYTHON.touch()
            return ()

        return action

    actions = ("make_environment", "install_dependencies", "build_interfaces", "build_kernels", "install_packages")
    for action in actions:
        monkeypatch.setattr(tool, action, step(action.partition("_")[2]))
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
        ("only.cmake", ["interfaces"]),
        ("kernels/a.cpp", ["kernels"]),
        ("package/setup.py", ["packages"]),
        ("tf2_ros/pyproject.toml", ["packages"]),
    ],
)
def test_a_change_repeats_what_depends_on_it(workspace, changed, steps):
    again(workspace)
    (workspace.ROOT / changed).write_text("changed")
    assert again(workspace) == steps


def test_a_renamed_message_or_moved_environment_is_a_change(workspace):
    again(workspace)
    (workspace.ROOT / "msgs" / "A.msg").rename(workspace.ROOT / "msgs" / "B.msg")
    assert again(workspace) == ["interfaces"]
    (workspace.STAMPS / "environment").write_text("key of another folder")
    assert again(workspace) == ALL


@pytest.mark.parametrize("step", ["make_environment", "install_dependencies"])
def test_interrupted_installation_starts_anew(workspace, monkeypatch, step):
    with monkeypatch.context() as patch:

        def interrupted():
            raise KeyboardInterrupt

        patch.setattr(workspace, step, interrupted)
        with pytest.raises(KeyboardInterrupt):
            again(workspace)
    (workspace.VENV / "half a package").touch()
    assert again(workspace) == ALL
    assert not (workspace.VENV / "half a package").exists()


def test_interrupted_build_goes_on_where_it_was(workspace, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:

        def fails():
            yield workspace.Command([sys.executable, "-c", "exit('no compiler')"], "")

        patch.setattr(workspace, "build_interfaces", fails)
        with (tmp_path / "lock").open("w") as lock, pytest.raises(workspace.SetupError, match="no compiler"):
            workspace.set_up(lock)
    # pip, which reads the metadata of all that is installed, had to wait for what writes it
    assert again(workspace) == ["interfaces", "packages"]


def test_environment_of_someone_else_is_left_alone(workspace):
    workspace.VENV.mkdir()
    (workspace.VENV / "theirs").touch()
    with pytest.raises(workspace.SetupError, match="not made by this set-up"):
        again(workspace)
    assert (workspace.VENV / "theirs").exists()


def test_a_machine_that_lacks_something_is_told_what(load_tool, monkeypatch):
    monkeypatch.setenv("ROS", "humble")
    tool = load_tool("setup_workspace")
    assert tool.VENV.name == ".venv-humble"
    with pytest.raises(tool.SetupError, match=r"ROS=humble: .* only: jazzy, kilted"):
        tool.set_up(lock=None)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(tool.SetupError, match="apt install cmake"):
        tool.check_machine()
    monkeypatch.setattr(tool.sys, "version_info", (3, 9, 1))
    with pytest.raises(tool.SetupError, match=r"3\.10 to 3\.13"):
        tool.check_machine()


def test_the_environment_s_python_hands_over_to_its_base(root, tmp_path):
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


@pytest.fixture
def steps(workspace, tmp_path):
    """Take steps given by the Python code of their only command each; what they have printed is in their logs."""

    def take(**codes):
        workspace.STAMPS.mkdir(parents=True, exist_ok=True)
        workspace.LOGS.mkdir(exist_ok=True)
        steps = [
            (name, "key", lambda code=code: [workspace.Command([sys.executable, "-c", code], "Mend it so.")], name)
            for name, code in codes.items()
        ]
        with (tmp_path / "lock").open("w") as lock:
            workspace.take(steps, workspace.Clock(), lock)

    return take


def test_failing_command_shows_its_end_and_the_mend(workspace, steps):
    with pytest.raises(workspace.SetupError) as error:
        steps(a="print('early'); [print('line', i) for i in range(40)]; exit(3)")
    assert "line 39" in str(error.value)
    assert "early" not in str(error.value)
    assert str(error.value).endswith("Mend it so.")
    assert "early" in (workspace.LOGS / "a.log").read_text()


def test_steps_of_a_stage_run_at_the_same_time_and_end_together(workspace, steps, tmp_path, capsys):
    """Each waits for the other one: opening a FIFO waits until its other end is opened, too."""
    os.mkfifo(tmp_path / "fifo")
    steps(a=f"open({str(tmp_path / 'fifo')!r}).read()", b=f"open({str(tmp_path / 'fifo')!r}, 'w').close()")
    assert workspace.is_done("a", "key")
    assert workspace.is_done("b", "key")
    assert {line.split("s  ")[1] for line in capsys.readouterr().out.splitlines()} >= {"a: done", "b: done"}
    with pytest.raises(workspace.SetupError):
        steps(waits=f"open({str(tmp_path / 'fifo')!r}).read()", fails="exit(1)")
    assert not workspace.is_done("waits", "key")
    assert not workspace.is_done("fails", "key")


def test_where_there_is_no_terminal_lines_tell_that_it_goes_on(workspace, monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(workspace.time, "monotonic", lambda: now[0])
    clock = workspace.Clock()
    for now[0] in range(13):
        clock.tick(["messages", "compiled inner loops"])
    clock.say("messages: done")
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["5", "s", "messages;", "compiled", "inner", "loops", "..."],
        ["10", "s", "messages;", "compiled", "inner", "loops", "..."],
        ["12", "s", "messages:", "done"],
    ]


def test_a_killed_set_up_keeps_others_out_until_its_command_ends(root, tmp_path):
    """The lock is inherited by the command, so nobody works on the same files beside an orphan."""
    code = f"""
import fcntl, sys, pathlib
sys.path.insert(0, {str(root / "tools")!r})
sys.dont_write_bytecode = True
import setup_workspace as tool
tool.STAMPS = tool.LOGS = pathlib.Path({str(tmp_path)!r})
with open({str(tmp_path / "lock")!r}, "w") as lock:
    fcntl.flock(lock, fcntl.LOCK_EX)
    child = "import sys; print('up', flush=True); sys.stdin.close(); open({str(tmp_path / "fifo")!r}).read()"
    step = lambda: [tool.Command([sys.executable, "-c", child], "")]
    tool.take([("step", "key", step, "step")], tool.Clock(), lock)
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
