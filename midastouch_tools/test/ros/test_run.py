"""What `midastouch run` starts, and how; that it starts the same as the launch files is in test_launch.py."""

import dataclasses
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh
from launch_rig import FILES
from recorded import write
from ros_graph import open_graph
from tf2_msgs.msg import TFMessage

from midastouch_common.errors import InputError
from midastouch_common.files import sole_use
from midastouch_perception.objects import bundled_objects
from midastouch_tools import cli
from midastouch_tools.bags.messages import Message, sequence_messages
from midastouch_tools.demo import preparation
from midastouch_tools.ros import explore, launch_file, run
from midastouch_tools.ros.launch_file import declared, manual, path_of, values
from midastouch_tools.ros.run import prepare, run_setup


def test_arguments_go_over_the_defaults():
    given = values("replay", ["bag:=out/my:=slide", "seed:=7"])
    assert (given["bag"], given["seed"], given["use_sim_time"]) == ("out/my:=slide", "7", "true")


def test_without_a_name_it_lists_what_can_be_started(capsys):
    assert cli.main(["run"]) == 0
    assert {"demo", "explore", "live_ur"} <= set(capsys.readouterr().out.splitlines())


@pytest.mark.parametrize(
    ("setup", "words", "reason"),
    [
        ("sofa", "", "sofa: nothing of that name can be started; there are .*driver, "),
        ("replay", "bag=slide", "bag=slide: write NAME:=VALUE"),
        ("driver", "serial:=../../etc", r"serial:= '\.\./\.\./etc': not a serial number; letters"),
        ("live_ur", "namespace:=2nd", "namespace:= '2nd': not a namespace; letters, digits"),
        ("replay", "bag:=a sensor_prefix:=left\u00a0", "sensor_prefix:= .*: not a frame; no spaces"),
        ("driver", "bag:=slide", "bag: driver takes no such argument; .* midastouch run driver --show-args"),
        ("replay", "bag:=a rate:=fast", "rate:= 'fast' is not a number from 0"),
        ("explore", "seed:=1.5", "seed:= '1.5' is not a whole number"),
        ("inhand", "pinches:=few", "pinches:= 'few' is not a whole number"),
        ("replay", "bag:=a loop:=yes", "loop:=yes: must be one of true, false"),
        ("replay", "object:=ball", "bag: must be given, bag:=VALUE"),
        ("live_ur", "arm:=finger", "arm:=finger: must be one of running, ur_driver, rtde"),
        ("filter", "params_file:=/none.yaml", "/none.yaml: no such parameter file"),
        ("explore", "namespace:=left", "namespace: midastouch run explore draws without one"),
        ("explore", "mesh:=none.stl", "mesh:=none.stl: no such file"),
        ("replay", "bag:=a object:=ball mesh:=box.ply", "object and mesh are both given"),
        ("live_ur", "mesh:=ball", "give the bundled object by its name, object:=ball"),
        ("mount", "frames_file:=none.yaml", "frames_file:=none.yaml: no such file"),
        ("explore", "mesh:=empty.ply", "empty.ply: cannot be read as a mesh"),
        ("live_ur", "mesh:=empty.ply", "empty.ply: cannot be read as a mesh"),
        ("explore", "objects:=ball,none.npz", "objects:=none.npz: no such file.*; bundled are ball, "),
        ("demo", "background:=none.png", "background:=none.png: no such file"),
        ("demo", "object:=sofa", "sofa: not bundled; there are"),
        ("filter", "codebook:=none.npz", r"no such file.*midastouch build-codebook MESH --out none\.npz"),
        ("live_ur", "object:=ball", "ball_digit_real.npz is not built yet: .* ball --sensor digit_real"),
        ("filter", "mesh:=package://none/a.ply", "no package 'none' is installed"),
    ],
)
def test_what_cannot_be_started_is_refused_before_anything_is_made(setup, words, reason, carried_out, monkeypatch):
    Path("empty.ply").touch()
    for make in ("ensure_codebook", "simulate_sequence"):
        monkeypatch.setattr(preparation, make, lambda *_args, **_options: pytest.fail("made"))
    with pytest.raises(InputError, match=reason):
        run_setup(setup, words.split(" "))
    assert carried_out == []
    assert [path.name for path in Path().iterdir()] == ["empty.ply"]


@pytest.mark.parametrize(("setup", "books", "lines"), [("live_ur", [], 2), ("digit_sim", [], 2), ("filter", ["a"], 0)])
def test_a_mesh_without_a_codebook_is_reported_on(setup, books, lines, carried_out, capsys):
    box = trimesh.creation.box((0.09, 0.05, 0.03))
    trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5]).export("box.ply")
    Path("a").touch()
    run_setup(setup, ["mesh:=box.ply", *(f"codebook:={book}" for book in books)])
    said = [line for line in capsys.readouterr().err.splitlines() if "box.ply" in line]
    assert len(said) == lines
    assert not said or "seen from behind" in said[-1]
    assert len(carried_out) == 1


def test_a_parameter_file_of_another_sensor_or_a_misspelt_node_is_refused(tmp_path):
    overlay = tmp_path / "mine.yaml"
    for name, refused in (("partcile_filter", True), ("tdnn", True), ("amcl", False), ("ur_control", False)):
        overlay.write_text(f"{name}: {{ros__parameters: {{seed: 3}}}}")
        if refused:
            with pytest.raises(InputError, match=f"mine.yaml: .*'{name}'.*did you mean "):
                values("filter", [f"params_overlay:={overlay}"])
        else:
            values("filter", [f"params_overlay:={overlay}"])
    overlay.write_text("tdn: {ros__parameters: {sensor_model: gelsight_mini}}")
    with pytest.raises(InputError, match=r"mine.yaml: tdn .*gelsight_mini.*digit_real.*sensor_model:=gelsight_mini"):
        values("live_ur", [f"params_overlay:={overlay}"])
    values("live_ur", [f"params_overlay:={overlay}", "sensor_model:=gelsight_mini"])


@pytest.mark.parametrize("setup", FILES)
def test_the_manual_names_every_argument(setup):
    text = manual(setup)
    for name, argument in declared(setup).items():
        assert f"  {name}:=" in text
        assert argument.description in text


@pytest.fixture
def carried_out(monkeypatch, tmp_path):
    """What would be carried out: name and arguments of each launch file."""
    seen = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(launch_file, "carry_out", lambda name, given: seen.append((name, given)) or 5)
    return seen


def test_a_launch_file_is_carried_out_without_rviz(carried_out):
    Path("a.ply").touch()
    assert run_setup("live_ur", ["namespace:=/left/", "mesh:=a.ply", "codebook:=a.ply", "log_level:=warn"]) == 5
    ((name, given),) = carried_out
    assert name == "live_ur"
    assert {"namespace": "/left/", "mesh": "a.ply", "log_level": "warn", "use_rviz": "false"}.items() <= given.items()
    run_setup("live_ur", ["use_rviz:=true"])
    assert carried_out[1][1]["use_rviz"] == "true"


def test_the_demo_is_prepared_and_stays_on_this_machine(carried_out, monkeypatch):
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    prepared = []
    monkeypatch.setattr(run, "prepare_slide", lambda name, mesh: prepared.append((name, Path(mesh).name)))
    assert run_setup("demo", []) == 5
    assert prepared == [("handle_tool", "handle_tool.ply")]
    assert carried_out[0][1]["prepare"] == "false"
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    prepare("demo", values("demo", ["object:=ball"]))
    prepare("replay", values("replay", ["bag:=a"]))
    assert ([name for name, _ in prepared], len(carried_out)) == (["handle_tool", "ball"], 1)


def test_a_failed_preparation_ends_the_demo(carried_out, monkeypatch):
    def fails(name, mesh):
        raise InputError("no space left")

    monkeypatch.setattr(run, "prepare_slide", fails)
    with pytest.raises(InputError, match="no space left"):
        run_setup("demo", [])
    assert carried_out == []


@pytest.fixture
def explored(monkeypatch, tmp_path):
    """What would be explored: codebooks built, and programs."""
    seen = {"built": {}}

    def run_exploration(programs, given, out, domain):
        seen.update(names=[program.name for program in programs], given=given, domain=domain)
        seen["ends"] = [program.name for program in programs if program.ends]
        seen["paused"] = "start_paused: true" in (out / "parameters" / "explorer_2.yaml").read_text()
        return 7

    monkeypatch.chdir(tmp_path)
    for name in ("cup.ply", "cup.npz", "own.npz"):
        Path(name).touch()
    monkeypatch.setattr(explore, "run_exploration", run_exploration)
    monkeypatch.setattr(run, "prepare_codebooks", seen["built"].update)
    return seen


def test_an_exploration_is_prepared_and_begins_paused(explored, tmp_path):
    assert run_setup("explore", ["object:=ball", "objects:=", "seed:=4"]) == 7
    ((codebook, _),) = explored["built"].items()
    assert codebook == str(tmp_path / "out" / "cache" / "codebooks" / "ball_10000.npz")
    assert set(explored["names"]) == {"digit_sim", "tdn", "tcn", "particle_filter", "simulated_finger", "explorer"}
    assert (explored["ends"], explored["paused"]) == (["explorer"], True)
    assert explored["domain"] == int(os.environ["ROS_DOMAIN_ID"])


@pytest.mark.parametrize(
    ("words", "built"),
    [
        ("mesh:=cup.ply codebook:=cup.npz objects:=", []),
        ("mesh:=cup.ply objects:=ball,own.npz", ["ball.ply", "cup.ply"]),
        ("object:=ball", sorted(f"{name}.ply" for name in bundled_objects())),
    ],
)
def test_codebooks_that_are_missing_are_built_for_an_exploration(explored, words, built):
    run_setup("explore", words.split())
    assert sorted(Path(mesh).name for mesh in explored["built"].values()) == built


@pytest.mark.slow
@pytest.mark.dds
@pytest.mark.parametrize("copied", [False, True])
def test_a_real_node_runs_until_ctrl_c(copied, tmp_path):
    """Of our launch file, and of a copy that a user has changed."""
    name, prefix = "mount", "sensor_prefix:=left_"
    if copied:
        name, prefix = str(tmp_path / "mine.launch.py"), "use_rviz:=false"
        text = path_of("mount").read_text()
        assert text.count('"sensor_prefix": (""') == 1
        Path(name).write_text(text.replace('"sensor_prefix": (""', '"sensor_prefix": ("left_"'))
    with open_graph() as graph:
        command = [sys.executable, "-m", "midastouch_tools.cli", "run", name, prefix]
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
    ours = [line.split()[1] for line in output.splitlines() if line.startswith("[midastouch]")]
    assert ours == ["starting", "ending"]


def test_two_do_not_explore_in_one_folder(explored):
    with sole_use(Path("out/explore")), pytest.raises(InputError, match="another run"):
        run_setup("explore", ["object:=ball", "objects:="])
    assert "names" not in explored
    assert run_setup("explore", ["object:=ball", "objects:="]) == 7


def test_what_a_killed_run_left_is_removed_and_own_files_kept(explored):
    left, former, own = (Path("out/explore") / name for name in (".unfinished", "result.json", "notes.txt"))
    left.mkdir(parents=True)
    (left.parent / ".made").write_text("result.json")
    for path in (left / "run.mcap", former, own):
        path.touch()
    run_setup("explore", ["object:=ball", "objects:="])
    assert sorted(path.name for path in left.parent.iterdir()) == [".lock", ".made", "notes.txt", "parameters"]


def test_a_recording_without_poses_is_named_before_it_plays(carried_out, simulated_sequence, tmp_path, capsys):
    static, moving, _, image = sequence_messages(simulated_sequence(n=1))

    def play(name: str, *messages: Message) -> str:
        write(tmp_path / f"{name}.mcap", *messages)
        run_setup("replay", [f"bag:={tmp_path / name}.mcap", "objects:=ball"])
        return capsys.readouterr().out

    assert play("whole", static, moving, image).endswith(f"\n[midastouch] reading {tmp_path}/whole.mcap\n")
    assert "no recorded transforms lead from 'base_link' to 'digit_gel_frame'" in play("still", static, image)
    carried_out.clear()
    with pytest.raises(InputError, match=r"odd.mcap: image on /image_raw"):
        play("odd", static, moving, dataclasses.replace(moving, topic="/image_raw"))
    assert carried_out == []
