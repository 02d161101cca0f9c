"""What the launch files start, by their arguments, and what they are made of."""

import ast
import importlib
import inspect
import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from launch.on_wheels import commands
from launch_rig import FILES, carried_out, parameters, started

from midastouch_perception.objects import bundled_objects
from midastouch_tools.cli import build_parser
from midastouch_tools.demo.preparation import explored
from midastouch_tools.ros.launch_file import declared, path_of

ROOT = Path(__file__).parents[2]
FACTS = yaml.safe_load((ROOT / "tests" / "facts" / "launch.yaml").read_text())
WITHOUT_TOOL = {"arm": "rtde", "robot_ip": "the.arm"}
RTDE = WITHOUT_TOOL | {"tcp_offset": "[0.0, 0.0, 0.1, 0.0, 0.0, 0.0]"}
CHAIN = {"mount_tf", "digit_driver", "tdn", "tcn", "particle_filter"}


@pytest.fixture
def more_is_installed(monkeypatch, tmp_path):
    """Packages of ROS that PyPI lacks, of which the launch files start something."""
    prefix = tmp_path / "prefix"
    for package, executable in (("rviz2", "rviz2"), ("robot_state_publisher", "robot_state_publisher")):
        (prefix / "share/ament_index/resource_index/packages").mkdir(parents=True, exist_ok=True)
        (prefix / "share/ament_index/resource_index/packages" / package).touch()
        (prefix / "lib" / package).mkdir(parents=True)
        (prefix / "lib" / package / executable).touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{prefix}{os.pathsep}{os.environ['AMENT_PREFIX_PATH']}")


@pytest.mark.parametrize("name", FILES)
def test_a_launch_file_can_be_copied(name):
    """It needs launch and what comes with that, nothing of ours, and is short."""
    text = path_of(name).read_text()
    needs = {node.module or "" for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}
    needs |= {alias.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for alias in node.names}
    others = {"launch", "launch_ros", "ament_index_python", "yaml"}
    assert {one.partition(".")[0] for one in needs} <= others | sys.stdlib_module_names
    assert len(text.splitlines()) <= 100


def test_what_stands_for_launch_takes_no_other_arguments():
    ours = {}
    for module, known in FACTS["classes"].items():
        made = importlib.import_module(module)
        for name in known.keys() & vars(made).keys():
            taken = inspect.signature(getattr(made, name)).parameters.values()
            ours[module, name] = {one.name for one in taken if one.kind is not one.VAR_KEYWORD} - set(known[name])
    assert len(ours) > 20
    # a property of the real event, no argument
    assert set().union(*ours.values()) == {"process_name"}


def test_live_starts_the_chain_and_no_arm_unless_asked(tmp_path, more_is_installed, monkeypatch):
    assert started("live_ur", tmp_path).keys() == CHAIN
    assert started("live_ur", tmp_path, **RTDE).keys() == CHAIN | {"ur_tf"}
    monkeypatch.setattr("subprocess.run", lambda *_args, **_options: SimpleNamespace(stdout="<robot name='digit'/>"))
    with_view = carried_out("live_ur", tmp_path, use_rviz="true")
    assert with_view.keys() == CHAIN | {"robot_state_publisher", "rviz2"}
    assert "robot_description:=digit_description" in with_view["robot_state_publisher"]


def test_an_argument_that_is_not_given_leaves_it_to_the_files(tmp_path):
    assert started("live_ur", tmp_path)["digit_driver"]["serial"] == ""
    words = {"serial": "D25", "seed": "7", "init_mode": "wait", "preset": "fast", "mesh": "a.ply", "codebook": "a.npz"}
    given = started("live_ur", tmp_path, **words)
    assert given["digit_driver"]["serial"] == given["tdn"]["serial"] == "D25"
    of_filter = given["particle_filter"]
    assert [of_filter[name] for name in ("seed", "init_mode", "preset", "mesh", "codebook")] == [
        *(7, "wait", "fast", "a.ply", "a.npz")
    ]
    overlay = tmp_path / "mine.yaml"
    overlay.write_text("tdn: {ros__parameters: {queue_depth: 7, serial: D1}}")
    over = started("replay", tmp_path, bag="x", params_overlay=str(overlay))["tdn"]
    assert (over["queue_depth"], over["reliable"], over["serial"]) == (7, True, "D1")
    assert started("replay", tmp_path, bag="x", params_overlay=str(overlay), serial="D2")["tdn"]["serial"] == "D2"


@pytest.mark.parametrize("composed", ["true", "false"])
def test_namespace_and_prefixes_reach_every_node(tmp_path, composed):
    words = {"namespace": "left", "sensor_prefix": "left_", "tf_prefix": "a_", "composed": composed, "seed": "3"}
    for command in carried_out("live_ur", tmp_path, **words, **RTDE).values():
        assert "__ns:=/left" in command
    found = started("live_ur", tmp_path, **words, **RTDE)
    assert found["particle_filter"]["sensor_frame_id"] == found["tdn"]["sensor_frame_id"] == "left_digit_gel_frame"
    assert (found["particle_filter"]["base_frame_id"], found["particle_filter"]["seed"]) == ("a_base_link", 3)
    assert found["digit_driver"]["frame_id"] == "left_digit_optical_frame"
    assert found["ur_tf"]["tf_prefix"] == found["mount_tf"]["tf_prefix"] == "a_"
    assert found["mount_tf"]["sensor_prefix"] == "left_"
    assert {found[node]["sensor_model"] for node in ("tdn", "tcn", "particle_filter")} == {"digit_real"}


def test_an_object_by_name_gives_mesh_and_codebook(tmp_path):
    found = started("filter", tmp_path, object="handle_tool")["particle_filter"]
    assert found["mesh"] == "package://midastouch_perception/midastouch_perception/objects/handle_tool.ply"
    assert found["codebook"] == str(Path("out/codebooks/handle_tool.npz").resolve())
    found = started("live_ur", tmp_path, object="handle_tool")["particle_filter"]
    assert found["codebook"].endswith("out/codebooks/handle_tool_digit_real.npz")
    found = started("filter", tmp_path, object="handle_tool", objects="ball,eyebolt")["particle_filter"]
    assert (found["objects"], found["mesh"], found["codebook"]) == ("ball,eyebolt", "", "")


def test_a_recording_is_played_without_loss_in_its_own_time(tmp_path):
    found = started("replay", tmp_path, bag="slide", rate="0", loop="true")
    of_replay = {"source": "slide", "rate": 0.0, "loop": True, "clock": True, "ack_topic": "filter_status"}
    assert of_replay.items() <= found["replay"].items()
    assert isinstance(found["replay"]["rate"], float)
    for node in ("tdn", "tcn", "particle_filter"):
        assert found[node]["use_sim_time"] is found[node]["reliable"] is True
        assert found[node]["queue_depth"] > 1
    live = started("live_ur", tmp_path)
    assert live["particle_filter"]["use_sim_time"] is False
    assert not live["digit_driver"].get("use_sim_time", False)


@pytest.mark.parametrize(
    ("inside", "used"),
    [
        (["background.png", "tactile_images"], "background.png"),
        (["tactile_images"], "tactile_images"),
        (["frames"], "frames"),
        ([], ""),
    ],
)
def test_a_sequence_brings_its_background(tmp_path, inside, used):
    for name in inside:
        (tmp_path / name).mkdir()
    found = started("replay", tmp_path, bag=str(tmp_path))["tdn"]
    assert found["background"] == (str(tmp_path / used) if used else "")
    (tmp_path / "slide.background.png").touch()
    beside = started("replay", tmp_path, bag=str(tmp_path / "slide.mcap"))["tdn"]["background"]
    assert beside == str(tmp_path / "slide.background.png")
    assert started("replay", tmp_path, bag=str(tmp_path), background="mine.png")["tdn"]["background"] == "mine.png"


def test_demo_and_exploration_have_midastouch_make_what_is_missing(tmp_path, monkeypatch):
    ran = []
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    monkeypatch.setattr("subprocess.run", lambda command, check: ran.append(command[1:]))
    for name in ("demo", "explore"):
        commands(path_of(name), {"object": "eyebolt", "use_rviz": "false"}, tmp_path)
        assert build_parser().parse_args(ran[-1]).prepare
        assert ran[-1][:2] == ["run", name]
        assert "object:=eyebolt" in ran[-1]
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"  # what is simulated stays on this machine
    assert started("demo", tmp_path, object="eyebolt")["replay"]["source"] == "out/slides/eyebolt"


@pytest.mark.parametrize("arm", ["finger", "mujoco"])
@pytest.mark.parametrize(
    "given",
    [
        {"object": "eyebolt", "objects": ""},
        {"mesh": "/data/cup.ply", "objects": "ball, own.npz"},
        {"mesh": "/data/cup.ply", "codebook": "/data/cup.npz", "objects": ""},
        {"object": "ball"},
    ],
)
def test_an_exploration_gives_all_nodes_one_object_and_seed(tmp_path, given, arm):
    words = {name: argument.default_value for name, argument in declared("explore").items()}
    defaults = {"mesh": "", "codebook": "", "object": "star_knob", "objects": ",".join(bundled_objects())}
    assert words.keys() >= defaults.keys()
    what = explored({**defaults, **given})
    found = started("explore", tmp_path, arm=arm, **given)
    moves = {"finger": {"simulated_finger"}, "mujoco": {"mujoco_arm", "contact_controller"}}[arm]
    assert found.keys() == {"digit_sim", "tdn", "tcn", "particle_filter", "explorer"} | moves
    meshes = {Path(found[node]["mesh"]).name for node in found if found[node].get("mesh")}
    assert meshes == {Path(what["mesh"]).name}
    of_filter = found["particle_filter"]
    assert of_filter.get("objects", "") == what["objects"]
    assert of_filter["codebook"] == ("" if what["objects"] else what["codebook"])
    assert {found[node]["seed"] for node in ("digit_sim", "particle_filter", "explorer")} == {2}
    assert of_filter["use_sim_time"] == found["explorer"]["use_sim_time"] == (arm == "mujoco")


def test_an_arm_that_explores_has_a_box_and_waits_for_a_person(tmp_path):
    assert "ur_speed" not in started("explore_ur", tmp_path)
    words = {"mesh": "a.ply", "tf_prefix": "a_", "sensor_prefix": "b_", **RTDE}
    found = started("explore_ur", tmp_path, **words)
    assert CHAIN | {"ur_tf", "ur_speed", "contact_controller", "recorder", "explorer"} == found.keys()
    assert found["explorer"]["start_paused"] is True
    # nobody but the user knows where it may move: both nodes refuse an empty box
    assert found["explorer"]["reach_low"] == found["explorer"]["reach_high"]
    assert found["contact_controller"]["box_low"] == found["contact_controller"]["box_high"]
    assert found["contact_controller"]["sensor_model"] == found["tdn"]["sensor_model"] == "digit_real"
    for name in ("robot_ip", "tcp_offset"):
        assert found["ur_speed"][name] == found["ur_tf"][name]
    assert found["ur_speed"]["tcp_offset"][2] == 0.1
    assert found["ur_speed"]["tool_frame_id"] == "a_tool0"
    for node in ("ur_speed", "contact_controller", "explorer"):
        assert found[node]["sensor_frame_id"] == "b_digit_gel_frame"


@pytest.mark.parametrize("given", [{}, {"hand": "running", "left_serial": "D1", "right_serial": "D2"}], ids=str)
def test_a_gripper_has_two_sensors_and_one_filter(given, tmp_path):
    found = started("inhand", tmp_path, object="ball", gripper_frame="tool0", **given)
    source = "digit_driver" if given else "digit_sim"
    assert found.keys() == {source, "tdn", "tcn", "particle_filter"} | (set() if given else {"simulated_gripper"})
    of_filter = found["particle_filter"]
    assert (of_filter["gripper_frame_id"], of_filter["base_frame_id"]) == ("tool0", "base_link")
    assert of_filter["fingers"] == "/right:right_digit_gel_frame"
    assert of_filter["reliable"] is not given, "what is simulated loses nothing"
    for number, side in enumerate(("left", "right"), 1):
        of_side = {}
        for node in (source, "tdn"):
            paths = sorted(tmp_path.glob(f"{side}_{node}_*.yaml"))  # which this node alone reads
            of_side[node] = parameters([word for path in paths for word in ("--params-file", str(path))], node)
        assert of_side["tdn"]["sensor_frame_id"] == f"{side}_digit_gel_frame"
        assert of_side["tdn"]["sensor_model"] == of_filter["sensor_model"] == ("digit_real" if given else "digit_tacto")
        assert of_side[source]["frame_id"] == f"{side}_digit_optical_frame"
        if given:
            assert of_side[source]["serial"] == of_side["tdn"]["serial"] == f"D{number}"
        else:
            assert of_side[source]["sensor_frame_id"] == f"{side}_digit_gel_frame"
            assert of_side[source]["seed"] == number - 1


@pytest.fixture
def ur_driver(tmp_path, monkeypatch):
    """A package `ur_robot_driver` whose launch file starts nothing."""
    (index := tmp_path / "share/ament_index/resource_index/packages").mkdir(parents=True)
    (index / "ur_robot_driver").touch()
    (launch := tmp_path / "share/ur_robot_driver/launch").mkdir(parents=True)
    nothing = (
        "from launch import LaunchDescription\ndef generate_launch_description():\n    return LaunchDescription([])\n"
    )
    (launch / "ur_control.launch.py").write_text(nothing)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}{os.pathsep}{os.environ['AMENT_PREFIX_PATH']}")


@pytest.mark.usefixtures("ur_driver")
def test_the_force_of_the_ur_driver_is_used_and_recorded(tmp_path):
    given = {"arm": "ur_driver", "use_mock_hardware": "true"}
    for words, remapped in ((given, True), (RTDE, False)):
        processes = carried_out("explore_ur", tmp_path, **words)
        for node in ("contact_controller", "recorder"):
            assert ("wrench:=/force_torque_sensor_broadcaster/wrench" in processes[node]) == remapped


@pytest.mark.parametrize(
    ("name", "given", "reason"),
    [
        ("explore_ur", WITHOUT_TOOL, "tcp_offset:=.*as on the teach pendant"),
        ("live_ur", WITHOUT_TOOL, "tcp_offset:=.*as on the teach pendant"),
        ("live_ur", {"arm": "rtde"}, "arm:=rtde: at which address"),
        ("live_ur", {"arm": "ur_driver"}, "arm:=ur_driver: at which address"),
        ("live_ur", {"arm": "ur_driver", "robot_ip": "1"}, "ur_robot_driver is not installed .* arm:=rtde"),
        ("live_ur", {"arm": "sofa"}, "arm:=sofa: must be one of"),
        ("inhand", {"hand": "running", "left_serial": "D1"}, "hand:=running: .* right_serial:=SERIAL"),
        *((name, {"params_overlay": "/none.yaml"}, "/none.yaml") for name in ("driver", "filter", "localization")),
    ],
)
def test_what_cannot_go_well_is_refused_before_anything_is_started(name, given, reason, tmp_path):
    """What was begun before an action raises would go on without launch."""
    assert FACTS["behaviour"]["an action raises after a process was begun"]["leaves"]
    with pytest.raises(RuntimeError, match=reason):
        started(name, tmp_path, **given)


@pytest.mark.parametrize("name", [name for name in FILES if name != "rviz"])
def test_nodes_exist_and_those_with_a_lifecycle_have_their_names(name, tmp_path):
    executables = set()
    for setup in ROOT.glob("*/setup.py"):
        executables |= set(re.findall(r'"(\w+) = [\w.]+:\w+"', setup.read_text()))
    found = carried_out(name, tmp_path, log_level="warn", **({"bag": "slide.mcap"} if name == "replay" else {}))
    for one, command in found.items():
        assert one in executables
        assert command[command.index("--log-level") + 1] == "warn"
        assert (f"__node:={one}" in command) <= (one != "all_in_one")


def test_every_argument_is_described():
    for name in FILES:
        assert all(argument.description for argument in declared(name).values()), name


def test_every_node_gets_an_enclave():
    (listed,) = re.findall(r"for node in (.*); do", (ROOT / "docs" / "security.md").read_text())
    setups = "".join(setup.read_text() for setup in ROOT.glob("*/setup.py"))
    executables = set(re.findall(r'"(\w+) = [\w.]+:\w+"', setups))
    # `midastouch view` starts that node; two executables have their former names beside the present ones
    assert set(listed.split()) == executables - {"midastouch", "slider", "finger"} | {"view"}


def test_packages_of_ros_that_are_started_are_declared():
    manifest = (ROOT / "midastouch_bringup" / "package.xml").read_text()
    for package in set(re.findall(r'package="(\w+)"', "".join(path_of(name).read_text() for name in FILES))):
        assert (ROOT / package).is_dir() or f"<exec_depend>{package}</exec_depend>" in manifest, package
