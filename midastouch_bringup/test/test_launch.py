"""The launch files. PyPI has no `launch`, so stand-ins with its semantics carry the descriptions out here.

Where the real one is installed, the descriptions are loaded with that as well.
"""

import importlib.util
import re
import sys
import types
from pathlib import Path

import pytest
import yaml

from midastouch_perception.errors import InputError

PACKAGE = Path(__file__).parents[1]
ROOT = PACKAGE.parent
FILES = sorted(path.name.removesuffix(".launch.py") for path in (PACKAGE / "launch").glob("*.launch.py"))
OURS = ("digit_driver", "midastouch_perception", "midastouch_filter", "midastouch_bringup")
REAL_LAUNCH = importlib.util.find_spec("launch") is not None and importlib.util.find_spec("launch_ros") is not None


# --- stand-ins: what each class means when a launch is carried out with `given`, the values of the arguments


class Stub:
    def __init__(self, *args, **kwargs):
        self.args, self.kwargs = args, kwargs

    def wanted(self, given):
        condition = self.kwargs.get("condition")
        return condition is None or condition.holds(given)


class LaunchConfiguration(Stub):
    def perform(self, given):
        return given[self.args[0]]


class EqualsSubstitution(Stub):
    def perform(self, given):
        return str(perform(self.args[0], given) == perform(self.args[1], given)).lower()


class Command(Stub):
    def perform(self, given):
        return perform(self.args[0], given)


class IfCondition(Stub):
    def holds(self, given):
        return {"true": True, "false": False}[perform(self.args[0], given)]


class UnlessCondition(IfCondition):
    def holds(self, given):
        return not super().holds(given)


def perform(value, given):
    if isinstance(value, list | tuple):
        return "".join(perform(part, given) for part in value)
    return value.perform(given) if hasattr(value, "perform") else str(value)


MODULES = {
    "launch": ["LaunchContext", "LaunchDescription", "LaunchDescriptionEntity"],
    "launch.actions": [
        "DeclareLaunchArgument", "ExecuteProcess", "IncludeLaunchDescription", "OpaqueFunction",
        "LogInfo", "RegisterEventHandler", "SetEnvironmentVariable", "Shutdown",
    ],
    "launch.event_handlers": ["OnProcessExit"],
    "launch.conditions": [IfCondition, UnlessCondition],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": [
        Command, "EnvironmentVariable", EqualsSubstitution, LaunchConfiguration, "PathJoinSubstitution"
    ],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
    "launch_ros.substitutions": ["ExecutableInPackage", "FindPackageShare"],
}  # fmt: skip


@pytest.fixture
def stand_ins(monkeypatch, tmp_path):
    for name, classes in MODULES.items():
        module = types.ModuleType(name)
        for one in classes:
            one = type(one, (Stub,), {}) if isinstance(one, str) else one
            setattr(module, one.__name__, one)
        monkeypatch.setitem(sys.modules, name, module)
    logging = types.ModuleType("launch.logging")
    logging.launch_config = types.SimpleNamespace(get_log_file_path=lambda name: str(tmp_path / name))
    sys.modules["launch"].logging = logging
    monkeypatch.setitem(sys.modules, "launch.logging", logging)
    monkeypatch.delitem(sys.modules, "midastouch_bringup.ros.launch_parts", raising=False)
    yield
    # the module was imported on top of the stand-ins: nobody else may get it
    sys.modules.pop("midastouch_bringup.ros.launch_parts", None)


def load(name):
    path = PACKAGE / "launch" / f"{name}.launch.py"
    spec = importlib.util.spec_from_file_location(f"{name}_launch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


def carry_out(name, said=None, **given):
    """All processes a launch starts: (package, executable) -> keyword arguments of its node.

    said: list that gets what the launch logs.
    """
    started = {}
    _carry_out(name, given, started, [], [] if said is None else said)
    return started


def _carry_out(name, given, started, ran, said):
    actions = list(load(name).args[0])
    while actions:
        action = actions.pop(0)
        kind = type(action).__name__
        if not action.wanted(given):
            continue
        if kind == "DeclareLaunchArgument":
            given.setdefault(action.args[0], action.kwargs["default_value"])
            choices = action.kwargs["choices"]
            assert not choices or given[action.args[0]] in choices
        elif kind == "OpaqueFunction":
            context = types.SimpleNamespace(launch_configurations=given)
            actions = action.kwargs["function"](context) + actions
        elif kind == "Node":
            started[action.kwargs["package"], action.kwargs["executable"]] = action.kwargs
        elif kind == "IncludeLaunchDescription":
            (location,) = action.args[0].args
            arguments = {key: perform(value, given) for key, value in action.kwargs["launch_arguments"]}
            if isinstance(location, str):
                _carry_out(Path(location).name.removesuffix(".launch.py"), {**given, **arguments}, started, ran, said)
            else:
                package, *inside = location.args[0]
                started[package.args[0], "/".join(inside)] = arguments
        elif kind == "ExecuteProcess":
            program, *arguments = action.kwargs["cmd"]
            assert (program.args[1], program.args[0]) in executables_of_setup_py()
            ran.append(arguments)
        elif kind == "RegisterEventHandler":
            # as if the process it waits for had ended well
            event = types.SimpleNamespace(returncode=0, process_name="")
            actions.append(action.args[0].kwargs["on_exit"](event, None))
        elif kind == "LogInfo":
            said.append(action.kwargs["msg"])
        elif kind == "SetEnvironmentVariable":
            name, value = action.args
            assert value.args == (name,)  # what the user has set stays
        else:
            raise AssertionError(f"{kind} is not known to this test")


def executables_of_setup_py():
    """(package, executable) of every entry point in the setup.py files."""
    found = set()
    for package in OURS:
        text = (ROOT / package / "setup.py").read_text()
        found |= {(package, name) for name in re.findall(r'"(\w+) = [\w.]+:\w+"', text)}
    return found


def parameters(kwargs):
    """Parameters by full node name, of a node started by us."""
    (path,) = kwargs["parameters"]
    return {name: node["ros__parameters"] for name, node in yaml.safe_load(Path(path).read_text()).items()}


def names(started):
    return {executable for _, executable in started}


# --- tests


def test_the_launch_files_that_users_know_exist():
    assert {"driver", "perception", "filter", "rviz", "live_ur", "replay", "demo"} <= set(FILES)


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
    started = carry_out(name, bag="/somewhere", arm="rtde") if name == "live_ur" else carry_out(name)
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
    assert names(carry_out("live_ur", use_rviz="false", arm="rtde")) == chain - {"rviz2"} | {"ur_tf"}
    driver = carry_out("live_ur", arm="ur_driver", robot_ip="10.0.0.7", ur_type="ur10e")
    assert names(driver) == chain | {"launch/ur_control.launch.py"}
    arguments = driver["ur_robot_driver", "launch/ur_control.launch.py"]
    assert arguments["robot_ip"] == "10.0.0.7"
    assert arguments["ur_type"] == "ur10e"
    assert arguments["launch_rviz"] == "false"


@pytest.mark.usefixtures("stand_ins")
def test_an_arm_without_its_calibration_is_warned_of():
    asked = {"arm": "ur_driver", "robot_ip": "10.0.0.7"}
    said = []
    without = carry_out("live_ur", said, **asked)["ur_robot_driver", "launch/ur_control.launch.py"]
    assert "kinematics_params_file" not in without  # what the driver takes by itself is its own affair
    assert "ur_calibration" in said[0]
    said.clear()
    calibrated = carry_out("live_ur", said, **asked, kinematics_params_file="/data/arm.yaml")
    arguments = calibrated["ur_robot_driver", "launch/ur_control.launch.py"]
    assert arguments["kinematics_params_file"] == "/data/arm.yaml"
    carry_out("live_ur", said, **asked, use_mock_hardware="true")
    carry_out("live_ur", said)
    assert said == []


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("composed", ["true", "false"])
@pytest.mark.parametrize("arm", ["running", "rtde"])
@pytest.mark.parametrize("name", FILES)
def test_run_starts_what_the_launch_file_starts(name, composed, arm, tmp_path, monkeypatch):
    from midastouch_bringup.ros.setups import SETUPS, executables

    monkeypatch.chdir(tmp_path)
    setup = SETUPS[name]
    given = setup.values() | {"composed": composed, "arm": arm}
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
def test_an_object_that_is_not_bundled_is_refused():
    with pytest.raises(InputError, match="sofa: not bundled; there are"):
        carry_out("filter", object="sofa")


@pytest.mark.usefixtures("stand_ins")
def test_namespace_and_prefixes_reach_every_node():
    started = carry_out("live_ur", namespace="left", sensor_prefix="left_", tf_prefix="a_", arm="rtde")
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
def test_the_demo_makes_what_is_missing_then_plays_it(tmp_path, monkeypatch):
    from midastouch_bringup.cli import build_parser

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("midastouch_bringup.codebooks.is_current", lambda path, mesh: Path(path).is_file())
    started = {}
    ran = []
    _carry_out("demo", {"use_rviz": "false"}, started, ran, [])
    assert [arguments[0] for arguments in ran] == ["simulate", "build-codebook"]
    slide, codebook = (build_parser().parse_args(arguments).out for arguments in ran)
    values = parameters(started["midastouch_bringup", "replay"])
    assert values["/replay"]["source"] == slide
    assert values["/particle_filter"]["codebook"] == str(Path(codebook).resolve())

    Path(slide).mkdir(parents=True)
    Path(codebook).parent.mkdir(parents=True)
    Path(codebook).touch()
    _carry_out("demo", {"use_rviz": "false"}, started, ran := [], [])
    assert ran == []


@pytest.mark.usefixtures("stand_ins")
def test_a_failed_preparation_ends_the_launch(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (prepare,) = (one for one in load("demo").args[0] if type(one).__name__ == "OpaqueFunction")
    given = types.SimpleNamespace(launch_configurations={"object": "handle_tool"})
    (first, *_) = prepare.kwargs["function"](given)
    event = types.SimpleNamespace(returncode=2, process_name="midastouch-1")
    assert type(first.args[0].kwargs["on_exit"](event, None)).__name__ == "Shutdown"


@pytest.mark.usefixtures("stand_ins")
def test_live_sensors_keep_wall_time():
    values = parameters(carry_out("live_ur", arm="rtde")["midastouch_bringup", "ur_tf"])
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


@pytest.mark.skipif(not REAL_LAUNCH, reason="ROS 2's launch and launch_ros are not installed")
@pytest.mark.parametrize("name", FILES)
def test_loads_with_the_real_launch(name):
    description = load(name)
    arguments = description.get_launch_arguments()
    assert arguments
    assert all(argument.description for argument in arguments)


@pytest.mark.usefixtures("stand_ins")
def test_the_demo_stays_on_this_machine():
    (first, *_) = load("demo").args[0]
    name, value = first.args
    assert (name, value.kwargs["default_value"]) == ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
