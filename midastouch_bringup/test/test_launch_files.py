"""What the launch files declare and need; where the real launch is installed, they are loaded with that as well."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from fake_launch import (
    FILES,
    OURS,
    PACKAGE,
    ROOT,
    executables_of_setup_py,
    installation,
    load,
)
from launch_rig import carry_out, given_to, parameters

REAL_LAUNCH = importlib.util.find_spec("launch") is not None and importlib.util.find_spec("launch_ros") is not None


@pytest.mark.usefixtures("stand_ins")
@pytest.mark.parametrize("name", FILES)
def test_the_arguments_and_their_defaults_are_those_of_run(name):
    from midastouch_bringup.ros.launch_arguments import ARGUMENTS
    from midastouch_bringup.ros.setups import SETUPS

    declared = [action for action in load(name).args[0] if type(action).__name__ == "DeclareLaunchArgument"]
    defaults = {action.args[0]: action.kwargs["default_value"] for action in declared}
    assert len(defaults) == len(declared)
    if name in SETUPS:
        assert defaults == SETUPS[name].values()
    else:
        assert defaults == {one: ARGUMENTS[one].default for one in defaults}


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
    started = carry_out(name, **given_to(name))
    ours = {key: kwargs for key, kwargs in started.items() if key[0] in OURS}
    assert set(ours) <= executables_of_setup_py()
    nodes = {f"/{executable}" for _, executable in executables_of_setup_py()}
    for kwargs in ours.values():
        assert set(parameters(kwargs)) <= nodes


def test_every_node_gets_an_enclave():
    (listed,) = re.findall(r"for node in (.*); do", (ROOT / "docs" / "security.md").read_text())
    executables = {name for _, name in executables_of_setup_py()}
    # `midastouch view` starts that node; two executables have their former names beside the present ones
    assert set(listed.split()) == executables - {"midastouch", "slider", "finger"} | {"view"}


@pytest.mark.usefixtures("stand_ins")
def test_other_packages_are_declared_as_dependencies():
    manifest = (PACKAGE / "package.xml").read_text()
    # ur_robot_driver is asked for by name (arm:=ur_driver) and by those who have such an arm
    for package, _ in carry_out("live_ur"):
        assert package in OURS or f"<exec_depend>{package}</exec_depend>" in manifest


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

    wanted = {"object": "handle_tool", "bag": str(tmp_path), "rate": "0", **given_to(name)}
    code = _ELSEWHERE.format(
        path=[str(Path(__file__).parent), *(str(ROOT / package) for package in OURS)],
        allowed={*OURS, "launch", "launch_ros", "ament_index_python", "yaml", "fake_launch"},
        log=str(tmp_path),
        name=name,
        given={key: value for key, value in wanted.items() if name in SETUPS and key in SETUPS[name].arguments},
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
