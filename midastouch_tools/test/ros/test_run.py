"""What `midastouch run` starts, and how; that it starts the same as the launch files is in test_launch.py."""

import dataclasses
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from ros_graph import open_graph
from tf2_msgs.msg import TFMessage

from midastouch_bringup.ros.launch_arguments import ARGUMENTS
from midastouch_bringup.ros.setups import SETUPS
from midastouch_common.errors import InputError
from midastouch_common.files import sole_use
from midastouch_perception.objects import bundled_objects
from midastouch_tools.bags.messages import Message, sequence_messages
from midastouch_tools.bags.writer import BagWriter
from midastouch_tools.demo import preparation
from midastouch_tools.ros import explore, run
from midastouch_tools.ros.run import manual, prepare, run_setup, values


def test_arguments_go_over_the_defaults():
    given = values("replay", ["bag:=out/my:=slide", "seed:=7"])
    assert (given["bag"], given["seed"], given["use_sim_time"]) == ("out/my:=slide", "7", "true")


@pytest.mark.parametrize(
    ("setup", "word", "reason"),
    [
        ("sofa", "", "sofa: nothing of that name can be started; there are driver, "),
        ("rviz", "", "rviz: nothing of that name"),
        ("replay", "bag=slide", "bag=slide: write NAME:=VALUE"),
        ("driver", "bag:=slide", "bag: driver takes no such argument; .* midastouch run driver --show-args"),
        ("replay", "use_rviz:=true", "use_rviz: only ros2 launch"),
        ("replay", "loop:=yes", "loop:=yes: must be one of true, false"),
        ("live_ur", "arm:=ur_driver", "only ros2 launch starts it"),
        ("explore", "namespace:=left", "namespace: midastouch run explore draws without one"),
    ],
)
def test_what_cannot_be_started_is_refused(setup, word, reason):
    with pytest.raises(InputError, match=reason):
        values(setup, [word] if word else [])


@pytest.mark.parametrize("setup", SETUPS)
def test_the_manual_names_every_argument_that_is_taken(setup):
    text = manual(setup)
    for name in SETUPS[setup].arguments:
        taken = f"  {name}:=" in text
        assert taken != ARGUMENTS[name].launch_only
        if taken:
            assert ARGUMENTS[name].description in text


@pytest.fixture
def supervised(monkeypatch):
    """What would be supervised: programs, environment, back-off, and the parameters they get."""
    seen = {}

    def run_in_foreground(programs, environment, respawn):
        seen.update(programs={p.name: p for p in programs}, environment=environment, respawn=respawn)
        for program in programs:
            file = program.command[program.command.index("--params-file") + 1]
            seen["parameters"] = yaml.safe_load(Path(file).read_text())
        return 5

    monkeypatch.setattr(run, "run_in_foreground", run_in_foreground)
    monkeypatch.setattr("midastouch_tools.processes.process.find_executable", lambda name: f"/bin/{name}")
    return seen


def test_nodes_get_parameters_namespace_and_log_level(supervised, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.ply").touch()
    words = ["namespace:=/left/", "mesh:=a.ply", "log_level:=warn"]
    assert run_setup("filter", words) == 5
    command = supervised["programs"]["particle_filter"].command
    assert command[:2] == ("/bin/particle_filter", "--ros-args")
    assert command[-4:] == ("--log-level", "warn", "-r", "__ns:=/left")
    assert supervised["parameters"]["/left/particle_filter"]["ros__parameters"]["mesh"] == "a.ply"
    assert supervised["respawn"] is None


def test_a_filter_without_an_object_is_said_to_wait_for_one(supervised, capsys, tmp_path):
    words = "particle_filter has no object and gives no pose: start again with object:=NAME"
    overlay = tmp_path / "mine.yaml"
    overlay.write_text("particle_filter: {ros__parameters: {mesh: part.ply}}")
    for setup, given, waits in (
        ("live_ur", [], True),
        ("localization", ["composed:=true"], True),
        ("live_ur", ["object:=ball"], False),
        ("live_ur", ["objects:=ball,eyebolt"], False),
        ("live_ur", [f"params_overlay:={overlay}"], False),
        ("driver", [], False),
        ("digit_sim", ["object:=ball"], False),
    ):
        assert run_setup(setup, given) == 5
        assert (words in capsys.readouterr().out) == waits, (setup, given)


def test_only_a_replay_ends_by_itself(supervised, simulated_sequence):
    run_setup("replay", [f"bag:={simulated_sequence(n=1).path}", "use_respawn:=true"])
    assert {name for name, program in supervised["programs"].items() if program.ends} == {"replay"}
    assert supervised["respawn"] is not None


def test_the_demo_is_prepared_and_stays_on_this_machine(supervised, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    prepared = []
    monkeypatch.setattr(preparation, "prepare_slide", lambda name, mesh: prepared.append((name, Path(mesh).name)))
    assert run_setup("demo", []) == 5
    assert prepared == [("handle_tool", "handle_tool.ply")]
    assert supervised["parameters"]["/replay"]["ros__parameters"]["source"] == "out/slides/handle_tool"
    assert supervised["environment"]["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE" not in os.environ


def test_the_demo_can_be_prepared_alone(supervised, monkeypatch):
    prepared = []
    monkeypatch.setattr(preparation, "prepare_slide", lambda name, mesh: prepared.append(name))
    prepare("demo", values("demo", ["object:=ball"]))
    prepare("replay", values("replay", []))
    assert (prepared, supervised) == (["ball"], {})


def test_a_failed_preparation_ends_the_demo(supervised, monkeypatch):
    def fails(name, mesh):
        raise InputError("no space left")

    monkeypatch.setattr(preparation, "prepare_slide", fails)
    with pytest.raises(InputError, match="no space left"):
        run_setup("demo", [])
    with pytest.raises(InputError, match="sofa: not bundled"):
        run_setup("demo", ["object:=sofa"])
    assert supervised == {}


@pytest.fixture
def explored(monkeypatch, tmp_path):
    """What would be explored: codebooks built, programs and parameters."""
    seen = {"built": {}}

    def run_exploration(programs, given, out, domain):
        nodes = yaml.safe_load((out / "parameters.yaml").read_text())
        seen.update(names=[p.name for p in programs], given=given, domain=domain)
        seen["parameters"] = {name.strip("/"): node["ros__parameters"] for name, node in nodes.items()}
        return 7

    monkeypatch.chdir(tmp_path)
    for name in ("cup.ply", "cup.npz", "own.npz"):
        Path(name).touch()
    monkeypatch.setattr(explore, "run_exploration", run_exploration)
    monkeypatch.setattr(preparation, "prepare_codebooks", seen["built"].update)
    monkeypatch.setattr("midastouch_tools.processes.process.find_executable", lambda name: f"/bin/{name}")
    return seen


def test_an_exploration_of_a_known_object_is_prepared_and_has_one_object_and_seed(explored, tmp_path):
    assert run_setup("explore", ["object:=ball", "objects:=", "seed:=4"]) == 7
    ((codebook, mesh),) = explored["built"].items()
    assert codebook == str(tmp_path / "out" / "cache" / "codebooks" / "ball_10000.npz")
    nodes = explored["parameters"]
    assert {nodes[node]["mesh"] for node in ("digit_sim", "simulated_finger", "explorer", "particle_filter")} == {mesh}
    assert {nodes[node]["seed"] for node in ("digit_sim", "simulated_finger", "explorer", "particle_filter")} == {4}
    assert nodes["particle_filter"]["codebook"] == codebook
    assert not nodes["particle_filter"].get("objects")
    assert explored["names"] == ["digit_sim", "tdn", "tcn", "particle_filter", "simulated_finger", "explorer"]
    assert explored["domain"] == int(os.environ["ROS_DOMAIN_ID"])


def test_a_codebook_that_is_given_is_not_built(explored):
    run_setup("explore", ["mesh:=cup.ply", "codebook:=cup.npz", "objects:="])
    assert explored["built"] == {}
    assert explored["parameters"]["particle_filter"]["codebook"] == "cup.npz"


def test_the_filter_is_not_told_which_object_is_explored(explored):
    run_setup("explore", ["mesh:=cup.ply", "objects:=ball, own.npz"])
    ball, cup = explored["built"]
    assert [Path(mesh).name for mesh in explored["built"].values()] == ["ball.ply", "cup.ply"]
    nodes = explored["parameters"]
    assert {nodes[node]["mesh"] for node in ("digit_sim", "simulated_finger", "explorer")} == {"cup.ply"}
    assert nodes["particle_filter"]["objects"] == f"{ball},own.npz,{cup}"
    assert not nodes["particle_filter"]["mesh"]
    assert not nodes["particle_filter"]["codebook"]


def test_by_default_it_may_be_any_bundled_object(explored):
    run_setup("explore", ["object:=ball"])
    assert sorted(Path(mesh).stem for mesh in explored["built"].values()) == sorted(bundled_objects())
    assert sorted(explored["parameters"]["particle_filter"]["objects"].split(",")) == sorted(explored["built"])


@pytest.mark.parametrize(
    ("setup", "word", "reason"),
    [
        ("explore", "mesh:=none.stl", "mesh:=none.stl: no such file"),
        ("explore", "mesh:=empty.ply", "empty.ply: cannot be read as a mesh"),
        ("explore", "objects:=ball,none.npz", "objects:=none.npz: no such file"),
        ("explore", "seed:=abc", "seed:=abc: must be a whole number"),
        ("demo", "background:=none.png", "background:=none.png: no such file"),
        ("demo", "seed:=abc", "seed:=abc: must be a whole number"),
        ("filter", "codebook:=none.npz", "codebook:=none.npz: no such file"),
        ("filter", "mesh:=package://none/a.ply", "no package 'none' is installed"),
    ],
)
def test_all_arguments_are_checked_before_anything_is_made(setup, word, reason, supervised, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("empty.ply").touch()
    for make in ("ensure_codebook", "simulate_sequence"):
        monkeypatch.setattr(preparation, make, lambda *_args, **_options: pytest.fail("made"))
    with pytest.raises(InputError, match=reason):
        run_setup(setup, [word])
    assert supervised == {}
    assert [path.name for path in tmp_path.iterdir()] == ["empty.ply"]


def test_nodes_that_are_not_installed_are_named_before_anything_is_made(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("midastouch_tools.processes.process.shutil.which", lambda *_args, **_options: None)
    with pytest.raises(InputError, match="executable 'digit_sim' is not installed"):
        run_setup("explore", [])
    assert not any(tmp_path.iterdir())


@pytest.mark.dds
def test_a_real_node_runs_until_ctrl_c():
    with open_graph() as graph:
        command = [sys.executable, "-m", "midastouch_tools.cli", "run", "mount", "sensor_prefix:=left_"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                static = graph.listen(TFMessage, "/tf_static", latched=True)
                graph.spin_until(lambda: static, "the mount")
                assert static[0].transforms[0].child_frame_id == "left_digit_link"
                process.send_signal(signal.SIGINT)
                output, _ = process.communicate()
            finally:
                process.kill()
    assert process.returncode == 0
    assert "[mount_tf] " in output
    # the node may still be saying what it sends
    assert [line for line in output.splitlines() if line.startswith("[midastouch]")] == ["[midastouch] ending all"]


def test_two_do_not_explore_in_one_folder(explored):
    with sole_use(Path("out/explore")), pytest.raises(InputError, match="another run"):
        run_setup("explore", ["object:=ball"])
    assert "names" not in explored
    assert run_setup("explore", ["object:=ball"]) == 7


def test_what_a_killed_run_has_left_is_removed_and_no_two_runs_are_mixed(explored):
    left, former, own = (Path("out/explore") / name for name in (".unfinished", "result.json", "notes.txt"))
    left.mkdir(parents=True)
    (left.parent / ".made").write_text("result.json")
    for path in (left / "run.mcap", former, own):
        path.touch()
    run_setup("explore", ["object:=ball"])
    assert sorted(path.name for path in left.parent.iterdir()) == [".lock", ".made", "notes.txt", "parameters.yaml"]


def test_a_recording_that_leads_to_no_pose_is_said_before_it_is_played(
    supervised, simulated_sequence, tmp_path, capsys
):
    static, moving, _, image = sequence_messages(simulated_sequence(n=1))

    def play(name: str, *messages: Message) -> str:
        with BagWriter(tmp_path / f"{name}.mcap") as bag:
            for message in messages:
                bag.write(message)
        run_setup("replay", [f"bag:={tmp_path / name}.mcap", "object:=ball"])
        return capsys.readouterr().out

    assert "no recorded transforms" not in play("whole", static, moving, image)
    assert "no recorded transforms lead from 'base_link' to 'digit_gel_frame'" in play("still", static, image)
    supervised.clear()
    with pytest.raises(InputError, match=r"odd.mcap: image on /image_raw"):
        play("odd", static, moving, dataclasses.replace(moving, topic="/image_raw"))
    assert supervised == {}
