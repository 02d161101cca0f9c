"""The launch files. PyPI has no `launch`, so stand-ins with its semantics carry the descriptions out here.

Where the real one is installed, the descriptions are loaded with that as well.
"""

import importlib.util
import os
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest
import yaml

from midastouch_perception.errors import InputError

sys.path.insert(0, str(Path(__file__).parent))

from fake_launch import (
    DEPENDENT,
    FACTS,
    FILES,
    OTHERS,
    OURS,
    PACKAGE,
    ROOT,
    Command,
    Launched,
    ended,
    executables_of_setup_py,
    installation,
    load,
    modules,
)

REAL_LAUNCH = importlib.util.find_spec("launch") is not None and importlib.util.find_spec("launch_ros") is not None
AN_ARM = {"arm": "rtde", "robot_ip": "the.arm"}


@pytest.fixture
def stand_ins(monkeypatch, tmp_path):
    """Stand-ins of launch, over an installation with what it is to start beside our nodes."""
    for name, module in modules(tmp_path).items():
        monkeypatch.setitem(sys.modules, name, module)
    prefixes = [installation(tmp_path / "prefix"), os.environ["AMENT_PREFIX_PATH"]]
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(prefixes))
    monkeypatch.delitem(sys.modules, DEPENDENT, raising=False)
    yield
    # the module was imported on top of the stand-ins: nobody else may get it
    sys.modules.pop(DEPENDENT, None)


def carry_out(name, **given):
    """All processes a launch starts: (package, executable) -> keyword arguments of its node."""
    return Launched().carry_out(name, **given)


def parameters(kwargs):
    """Parameters by full node name, of a node started by us."""
    (path,) = kwargs["parameters"]
    return {name: node["ros__parameters"] for name, node in yaml.safe_load(Path(path).read_text()).items()}


def names(started):
    return {executable for _, executable in started}


# --- tests


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_every_argument_is_described(name):
    declared = [action for action in load(name).args[0] if type(action).__name__ == "DeclareLaunchArgument"]
    for action in declared:
        assert len(action.kwargs["description"]) > 8
        choices = action.kwargs["choices"]
        assert not choices or action.kwargs["default_value"] in choices
    assert len({action.args[0] for action in declared}) == len(declared)


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_a_launch_file_declares_whatever_its_includes_need(name):
    """`--show-args` of the including file is then the whole manual; no default hides in an included one."""
    description = load(name).args[0]
    declared = {action.args[0] for action in description if type(action).__name__ == "DeclareLaunchArgument"}
    for action in description:
        if type(action).__name__ == "IncludeLaunchDescription" and isinstance(action.args[0].args[0], str):
            inner = load(Path(action.args[0].args[0]).name.removesuffix(".launch.py")).args[0]
            needed = {one.args[0] for one in inner if type(one).__name__ == "DeclareLaunchArgument"}
            assert needed <= declared, f"{name} includes {action.args[0].args[0]}"


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_our_nodes_have_entry_points_and_parameters_of_existing_nodes(name):
    started = carry_out(name, **(AN_ARM if name == "live_ur" else {}))
    ours = {key: kwargs for key, kwargs in started.items() if key[0] in OURS}
    assert set(ours) <= executables_of_setup_py()
    nodes = {f"/{executable}" for _, executable in executables_of_setup_py()}
    for kwargs in ours.values():
        assert set(parameters(kwargs)) <= nodes


def test_every_node_gets_an_enclave():
    (listed,) = re.findall(r"for node in (.*); do", (ROOT / "docs" / "security.md").read_text())
    assert set(listed.split()) == {name for _, name in executables_of_setup_py()} - {"midastouch"}


@pytest.mark.usefixtures("stand_ins")
def test_other_packages_are_declared_as_dependencies():
    manifest = (PACKAGE / "package.xml").read_text()
    # ur_robot_driver is asked for by name (arm:=ur_driver) and by those who have such an arm
    for package, _ in carry_out("live_ur"):
        assert package in OURS or f"<exec_depend>{package}</exec_depend>" in manifest


@pytest.mark.usefixtures("stand_ins")
def test_live_starts_the_chain_and_no_arm_unless_asked():
    chain = {"digit_driver", "tdn", "tcn", "particle_filter", "robot_state_publisher", "rviz2"}
    assert names(carry_out("live_ur")) == chain
    assert names(carry_out("live_ur", use_rviz="false", **AN_ARM)) == chain - {"rviz2"} | {"ur_tf"}
    driver = carry_out("live_ur", arm="ur_driver", robot_ip="10.0.0.7", ur_type="ur10e")
    assert names(driver) == chain | {"launch/ur_control.launch.py"}
    arguments = driver["ur_robot_driver", "launch/ur_control.launch.py"]
    assert arguments["robot_ip"] == "10.0.0.7"
    assert arguments["ur_type"] == "ur10e"
    assert arguments["launch_rviz"] == "false"


@pytest.mark.usefixtures("stand_ins")
def test_an_arm_without_its_calibration_is_warned_of():
    asked = {"arm": "ur_driver", "robot_ip": "10.0.0.7"}
    launched = Launched()
    without = launched.carry_out("live_ur", **asked)["ur_robot_driver", "launch/ur_control.launch.py"]
    assert "kinematics_params_file" not in without  # what the driver takes by itself is its own affair
    assert "ur_calibration" in launched.said[0]
    launched = Launched()
    calibrated = launched.carry_out("live_ur", **asked, kinematics_params_file="/data/arm.yaml")
    arguments = calibrated["ur_robot_driver", "launch/ur_control.launch.py"]
    assert arguments["kinematics_params_file"] == "/data/arm.yaml"
    launched.carry_out("live_ur", arm="ur_driver", use_mock_hardware="true")
    launched.carry_out("live_ur")
    assert launched.said == []


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("composed", ["true", "false"])
@pytest.mark.parametrize("arm", ["running", "rtde"])
@pytest.mark.parametrize("name", FILES)
def test_run_starts_what_the_launch_file_starts(name, composed, arm, tmp_path, monkeypatch):
    from midastouch_bringup.ros.setups import SETUPS, executables

    monkeypatch.chdir(tmp_path)
    setup = SETUPS[name]
    given = setup.values() | {"composed": composed, "arm": arm, "robot_ip": "the.arm"}
    started = carry_out(name, **{key: value for key, value in given.items() if key in setup.arguments})
    # PyPI has neither: a node of ours has the same TF, and midastouch view shows the same
    instead = {"robot_state_publisher": {"mount_tf"}, "rviz2": set()}
    expected = set().union(*(instead.get(one, {one}) for one in names(started)))
    ran = list(executables(name, given))
    assert {one.name for one in ran} == expected
    assert {(one.package, one.name) for one in ran} <= executables_of_setup_py()


@pytest.mark.usefixtures("stand_ins")
def test_composed_runs_perception_and_filter_in_one_process():
    started = names(carry_out("replay", composed="true", bag="x"))
    assert "all_in_one" in started
    assert not {"tdn", "tcn", "particle_filter"} & started


@pytest.mark.usefixtures("stand_ins")
def test_arguments_become_parameters_only_when_given():
    plain = parameters(carry_out("live_ur")["digit_driver", "digit_driver"])
    assert plain["/digit_driver"]["serial"] == ""
    given = carry_out("live_ur", serial="20025", seed="7", init_mode="wait", mesh="a.ply", codebook="a.npz")
    assert parameters(given["digit_driver", "digit_driver"])["/digit_driver"]["serial"] == "20025"
    assert parameters(given["midastouch_perception", "tdn"])["/tdn"]["serial"] == "20025"
    filter_ = parameters(given["midastouch_filter", "particle_filter"])["/particle_filter"]
    assert (filter_["seed"], filter_["init_mode"]) == (7, "wait")
    assert (filter_["mesh"], filter_["codebook"]) == ("a.ply", "a.npz")


@pytest.mark.usefixtures("stand_ins")
def test_an_object_by_name_gives_mesh_and_codebook():
    from midastouch_perception.objects import bundled_objects

    started = carry_out("filter", object="handle_tool")
    values = parameters(started["midastouch_filter", "particle_filter"])["/particle_filter"]
    assert values["mesh"] == str(bundled_objects()["handle_tool"])
    assert values["codebook"].endswith("out/codebooks/handle_tool.npz")


@pytest.mark.usefixtures("stand_ins")
def test_objects_by_name_are_their_meshes_until_they_have_codebooks(tmp_path, monkeypatch):
    from midastouch_perception.objects import bundled_objects

    monkeypatch.chdir(tmp_path)
    book = tmp_path / "out/codebooks/eyebolt.npz"
    book.parent.mkdir(parents=True)
    book.touch()
    started = carry_out("filter", objects="handle_tool, eyebolt,/data/cup.npz")
    values = parameters(started["midastouch_filter", "particle_filter"])["/particle_filter"]
    assert values["objects"] == f"{bundled_objects()['handle_tool']},{book},/data/cup.npz"
    assert values["mesh"] == values["codebook"] == ""


@pytest.mark.usefixtures("stand_ins")
def test_an_object_that_is_not_bundled_is_refused():
    with pytest.raises(InputError, match="sofa: not bundled; there are"):
        carry_out("filter", object="sofa")


@pytest.mark.usefixtures("stand_ins")
def test_namespace_and_prefixes_reach_every_node():
    started = carry_out("live_ur", namespace="left", sensor_prefix="left_", tf_prefix="a_", **AN_ARM)
    for (package, executable), kwargs in started.items():
        if package in OURS:
            assert kwargs["namespace"] == "left"
            assert f"/left/{executable}" in parameters(kwargs)
    values = parameters(started["midastouch_filter", "particle_filter"])
    assert values["/left/particle_filter"]["sensor_frame_id"] == "left_digit_gel_frame"
    assert values["/left/particle_filter"]["base_frame_id"] == "a_base_link"
    assert values["/left/tdn"]["sensor_frame_id"] == "left_digit_gel_frame"
    assert values["/left/digit_driver"]["frame_id"] == "left_digit_optical_frame"
    assert values["/left/ur_tf"]["tf_prefix"] == "a_"
    mount = started["robot_state_publisher", "robot_state_publisher"]["parameters"][0]["robot_description"]
    command = mount.args[0].perform({"frames_file": "f", "tool_frame": "", "tf_prefix": "a_", "sensor_prefix": "b_"})
    assert command.endswith(" frames_file:=f tool_frame:= tf_prefix:=a_ prefix:=b_")


@pytest.mark.usefixtures("stand_ins")
def test_a_recording_is_played_without_loss_in_its_own_time():
    started = carry_out("replay", bag="slide", rate="0", loop="true")
    values = parameters(started["midastouch_bringup", "replay"])
    assert values["/replay"]["source"] == "slide"
    assert values["/replay"]["rate"] == 0.0
    assert isinstance(values["/replay"]["rate"], float)
    assert values["/replay"]["loop"] is True
    assert values["/replay"]["clock"] is True
    assert values["/replay"]["ack_topic"] == "filter_status"
    for node in ("/tdn", "/tcn", "/particle_filter"):
        assert values[node]["use_sim_time"] is True
        assert values[node]["reliable"] is True
        assert values[node]["queue_depth"] > 1


@pytest.mark.usefixtures("stand_ins")
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
    values = parameters(carry_out("replay", bag=str(tmp_path))["midastouch_bringup", "replay"])
    assert values["/tdn"]["background"] == (str(tmp_path / used) if used else "")
    given = carry_out("replay", bag=str(tmp_path), background="mine.png")
    assert parameters(given["midastouch_bringup", "replay"])["/tdn"]["background"] == "mine.png"


@pytest.mark.usefixtures("stand_ins")
def test_the_demo_has_midastouch_make_what_is_missing_then_plays_it():
    from midastouch_bringup.cli import build_parser

    launched = Launched()
    launched.carry_out("demo", object="eyebolt", use_rviz="false")
    assert launched.ran == [["run", "demo", "object:=eyebolt", "--prepare"]]
    assert build_parser().parse_args(launched.ran[0]).prepare
    values = parameters(launched.started["midastouch_bringup", "replay"])
    assert values["/replay"]["source"] == "out/slides/eyebolt"
    assert values["/particle_filter"]["codebook"] == str(Path("out/codebooks/eyebolt.npz").resolve())


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize(
    ("given", "mesh", "codebook"),
    [
        ({"object": "eyebolt"}, "eyebolt.ply", "out/cache/codebooks/eyebolt_10000.npz"),
        ({"mesh": "/data/cup.ply"}, "/data/cup.ply", "out/cache/codebooks/cup_10000.npz"),
        ({"mesh": "/data/cup.ply", "codebook": "/data/cup.npz"}, "/data/cup.ply", "/data/cup.npz"),
    ],
    ids=["bundled", "mesh", "codebook"],
)
def test_an_exploration_gives_all_nodes_one_object(given, mesh, codebook):
    launched = Launched()
    started = launched.carry_out("explore", use_rviz="false", **given, objects="")
    assert [words[:2] + words[-1:] for words in launched.ran] == [["run", "explore", "--prepare"]]
    assert names(started) == {"digit_sim", "tdn", "tcn", "particle_filter", "explorer"}
    own = {executable: parameters(kwargs)[f"/{executable}"] for (_, executable), kwargs in started.items()}
    meshes = {Path(own[node]["mesh"]).name for node in ("digit_sim", "explorer", "particle_filter")}
    assert meshes == {Path(mesh).name}
    assert own["particle_filter"]["codebook"] == str(Path(codebook).resolve())
    assert own["tdn"]["reliable"]


@pytest.mark.usefixtures("stand_ins")
def test_a_failed_preparation_ends_the_launch():
    (_, prepare) = (one for one in load("demo").args[0] if type(one).__name__ == "OpaqueFunction")
    context = types.SimpleNamespace(launch_configurations={"object": "handle_tool"}, is_shutdown=False)
    (process,) = prepare.kwargs["function"](context)
    with pytest.raises(RuntimeError, match="midastouch-1 died with exit code 2"):
        process.kwargs["on_exit"](ended(2, "midastouch-1"), context)
    context.is_shutdown = True  # Ctrl-C
    assert process.kwargs["on_exit"](ended(130), context) is None
    assert process.kwargs["on_exit"](ended(0), context) is None


@pytest.mark.usefixtures("stand_ins")
def test_live_sensors_keep_wall_time():
    values = parameters(carry_out("live_ur", **AN_ARM)["midastouch_bringup", "ur_tf"])
    assert values["/particle_filter"]["use_sim_time"] is False
    assert not values["/digit_driver"].get("use_sim_time", False)
    assert not values["/ur_tf"].get("use_sim_time", False)


@pytest.mark.usefixtures("stand_ins")
def test_respawn_and_log_level():
    kwargs = carry_out("driver", use_respawn="true", log_level="debug")["digit_driver", "digit_driver"]
    assert kwargs["respawn"] is True
    assert kwargs["arguments"] == ["--ros-args", "--log-level", "debug"]
    assert carry_out("driver")["digit_driver", "digit_driver"]["respawn"] is False
    # a recording that has ended has not died
    assert carry_out("replay", use_respawn="true")["midastouch_bringup", "replay"]["respawn"] is False


@pytest.mark.usefixtures("stand_ins")
def test_a_misspelt_node_in_a_parameter_file_is_refused_a_strange_one_is_not(tmp_path):
    overlay = tmp_path / "mine.yaml"
    for name, refused in (("partcile_filter", True), ("tdnn", True), ("amcl", False), ("ur_control", False)):
        overlay.write_text(f"{name}: {{ros__parameters: {{seed: 3}}}}")
        if refused:
            with pytest.raises(InputError, match=f"mine.yaml: no node '{name}'; did you mean "):
                carry_out("filter", params_overlay=str(overlay))
        else:
            carry_out("filter", params_overlay=str(overlay))


WRONG = [
    ("live_ur", {**AN_ARM, "seed": "abc"}, "seed:=abc: must be a whole number"),
    ("live_ur", {**AN_ARM, "object": "sofa"}, "sofa: not bundled"),
    ("live_ur", {**AN_ARM, "params_file": "/nowhere.yaml"}, "/nowhere.yaml: No such file"),
    ("live_ur", {"arm": "rtde"}, "arm:=rtde: at which address"),
    ("live_ur", {"arm": "rtde", "use_mock_hardware": "true"}, "arm:=rtde: at which address"),
    ("live_ur", {"arm": "ur_driver"}, "arm:=ur_driver: at which address"),
    ("replay", {"rate": "fast"}, "rate:=fast: must be a number"),
    ("demo", {"object": "sofa"}, "sofa: not bundled"),
    *((name, {"params_overlay": "/nowhere.yaml"}, "/nowhere.yaml") for name in ("driver", "filter", "localization")),
]


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize(("name", "given", "reason"), WRONG)
def test_a_wrong_argument_is_refused_before_anything_is_started(name, given, reason):
    """What was begun before an action raises would go on without launch."""
    assert FACTS["behaviour"]["an action raises after a process was begun"]["leaves"]
    launched = Launched()
    with pytest.raises(InputError, match=reason):
        launched.carry_out(name, **given)
    assert (launched.started, launched.ran) == ({}, [])


@pytest.mark.usefixtures("stand_ins")
def test_a_mount_that_cannot_be_described_is_refused_before_anything_is_started(monkeypatch):
    def fails(line):
        raise RuntimeError(f"executed command failed. Command: {line}")

    monkeypatch.setattr(Command, "ran", staticmethod(fails))
    launched = Launched()
    with pytest.raises(RuntimeError, match="frames_file:=/nowhere"):
        launched.carry_out("live_ur", **AN_ARM, frames_file="/nowhere")
    assert launched.started == {}


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("missing", OTHERS)
def test_what_is_not_installed_is_named_before_anything_is_started(missing, tmp_path, monkeypatch):
    there = installation(tmp_path / "less", [package for package in OTHERS if package != missing])
    monkeypatch.setenv("AMENT_PREFIX_PATH", there)
    launched = Launched()
    mend = f"{missing} is not installed: sudo apt install ros-$ROS_DISTRO-{missing.replace('_', '-')}, or "
    with pytest.raises(InputError, match=re.escape(mend)):
        launched.carry_out("live_ur", arm="ur_driver", robot_ip="the.arm")
    assert launched.started == {}


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_a_process_that_dies_for_good_ends_the_launch(name):
    behaviour = FACTS["behaviour"]
    assert behaviour["on_exit raises"] == {"exit": 1, "leaves": False}
    assert behaviour["on_exit returns Shutdown while launch is shutting down"]["exit"] == 1
    running, ending = (types.SimpleNamespace(is_shutdown=done) for done in (False, True))
    for (_, executable), kwargs in carry_out(name, **(AN_ARM if name == "live_ur" else {})).items():
        on_exit = kwargs["on_exit"]
        assert on_exit(ended(-2), ending) is None
        if executable == "rviz2":
            assert type(on_exit(ended(0), running)).__name__ == "Shutdown"
        else:
            with pytest.raises(RuntimeError, match="node-1 died with exit code 2: ending all"):
                on_exit(ended(2), running)
    if name not in ("rviz", "demo"):
        for (_, executable), kwargs in carry_out(name, use_respawn="true").items():
            # not the replay, which would play twice, nor the explorer, nor RViz, which the user has closed
            again = executable not in ("replay", "explorer", "rviz2")
            assert (kwargs.get("respawn", False), kwargs["on_exit"] is None) == (again, again)


@pytest.mark.usefixtures("stand_ins")
def test_a_replay_that_has_finished_leaves_the_others_to_be_looked_at():
    on_exit = carry_out("replay")["midastouch_bringup", "replay"]["on_exit"]
    said = on_exit(ended(0, "replay-4"), types.SimpleNamespace(is_shutdown=False))
    assert said.kwargs["msg"] == "replay-4 has finished; Ctrl-C ends the others"


@pytest.mark.usefixtures("stand_ins")
def test_lifecycle_nodes_are_launched_as_such():
    launched = Launched()
    launched.carry_out("live_ur", namespace="left", **AN_ARM)
    lifecycle = {name for name, kind in launched.kinds.items() if kind == "LifecycleNode"}
    assert lifecycle == {"digit_driver", "tdn", "tcn", "particle_filter"}
    for (_, executable), kwargs in launched.started.items():
        if executable in lifecycle:
            assert (kwargs["name"], kwargs["namespace"]) == (executable, "left")
    # a name given to that process would be the name of all its nodes
    launched.carry_out("localization", composed="true")
    assert launched.kinds["all_in_one"] == "Node"


def test_the_arms_are_those_of_the_ur_driver():
    from midastouch_bringup.ros.launch_arguments import ARGUMENTS

    driver = yaml.safe_load((ROOT / "tests" / "facts" / "ur_driver.yaml").read_text())
    assert sorted(ARGUMENTS["ur_type"].choices) == sorted(driver["ur_type"])


_ELSEWHERE = """
import sys

sys.path[:0] = {path}


class Nothing:
    # the Python of `ros2 launch`: what pip has put into an environment is not there
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in {allowed} and top not in sys.stdlib_module_names:
            raise ModuleNotFoundError(f"No module named '{{name}}'", name=name)


for name in [name for name in sys.modules if name.partition(".")[0] not in sys.stdlib_module_names]:
    del sys.modules[name]
import yaml  # of launch
sys.meta_path.insert(0, Nothing())

from fake_launch import Launched, installation, modules

sys.modules.update(modules({log!r}))
launched = Launched()
launched.carry_out({name!r}, **{given!r})
print(len(launched.started))
"""


@pytest.mark.parametrize("name", FILES)
def test_launch_files_need_nothing_but_launch_and_the_standard_library(name, tmp_path):
    """Carried out in a Python that has launch, what launch needs, and our packages."""
    from midastouch_bringup.ros.setups import SETUPS

    wanted = {"object": "handle_tool", "bag": str(tmp_path), "rate": "0", **AN_ARM}
    code = _ELSEWHERE.format(
        path=[str(Path(__file__).parent), *(str(ROOT / package) for package in OURS)],
        allowed={*OURS, "launch", "launch_ros", "ament_index_python", "yaml", "fake_launch"},
        log=str(tmp_path),
        name=name,
        given={key: value for key, value in wanted.items() if key in SETUPS[name].arguments},
    )
    prefixes = [installation(tmp_path / "prefix"), os.environ["AMENT_PREFIX_PATH"]]
    environment = {**os.environ, "AMENT_PREFIX_PATH": os.pathsep.join(prefixes)}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 0


@pytest.mark.skipif(not REAL_LAUNCH, reason="ROS 2's launch and launch_ros are not installed")
@pytest.mark.parametrize("name", FILES)
def test_loads_with_the_real_launch(name):
    description = load(name)
    arguments = description.get_launch_arguments()
    assert arguments
    assert all(argument.description for argument in arguments)


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", ["demo", "explore"])
def test_what_is_simulated_stays_on_this_machine(name):
    (first, *_) = load(name).args[0]
    variable, value = first.args
    assert (variable, value.kwargs["default_value"]) == ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
