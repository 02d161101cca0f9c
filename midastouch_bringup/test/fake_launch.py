"""Stand-ins for `launch` and `launch_ros`, which PyPI does not have, and what carries the launch files out with them.

They have the names and take the arguments that are recorded of the real ones in tests/facts/launch.yaml, no others.
"""

import importlib.util
import re
import types
from pathlib import Path

import yaml

PACKAGE = Path(__file__).parents[1]
ROOT = PACKAGE.parent
FACTS = yaml.safe_load((ROOT / "tests" / "facts" / "launch.yaml").read_text())
FILES = sorted(path.name.removesuffix(".launch.py") for path in (PACKAGE / "launch").glob("*.launch.py"))
OURS = (
    *("midastouch_common", "digit_driver", "midastouch_perception", "midastouch_filter", "midastouch_motion"),
    *("midastouch_bringup", "midastouch_simulation", "midastouch_tools"),
)
# holds, once imported, what was imported on top of the stand-ins
DEPENDENT = "midastouch_bringup.ros.launch_parts"
# what the launch files start beside our nodes
OTHERS = ("robot_state_publisher", "rviz2", "ur_robot_driver")


class Stub:
    """An action, event or substitution. `perform` and `holds` say what it means with `given`, the launch arguments."""

    taken: tuple[str, ...] = ()

    def __init__(self, *args, **kwargs):
        unknown = kwargs.keys() - set(self.taken)
        if unknown or len(args) + len(kwargs) > len(self.taken):
            raise TypeError(f"{type(self).__name__} takes {self.taken}, not {args} and {sorted(kwargs)}")
        self.args, self.kwargs = args, kwargs

    def wanted(self, given):
        condition = self.kwargs.get("condition")
        return condition is None or condition.holds(given)


class LaunchConfiguration(Stub):
    def perform(self, given):
        return given[self.args[0]] if "default" not in self.kwargs else given.get(self.args[0], self.kwargs["default"])


class EqualsSubstitution(Stub):
    def perform(self, given):
        return str(perform(self.args[0], given) == perform(self.args[1], given)).lower()


class PathJoinSubstitution(Stub):
    def perform(self, given):
        return str(Path(*(perform(part, given) for part in self.args[0])))


class Command(Stub):
    """`ran` is what is called with the command line, and returns its output."""

    ran = staticmethod(lambda line: f"output of {line}")

    def perform(self, given):
        return Command.ran(perform(self.args[0], getattr(given, "launch_configurations", given)))


class IfCondition(Stub):
    def holds(self, given):
        return {"true": True, "false": False}[perform(self.args[0], given)]


class UnlessCondition(IfCondition):
    def holds(self, given):
        return not super().holds(given)


_MEANT = LaunchConfiguration, EqualsSubstitution, PathJoinSubstitution, Command, IfCondition, UnlessCondition
_WITH_MEANING = {one.__name__: one for one in _MEANT}


def perform(value, given):
    """The text that a substitution, or a list of substitutions and texts, stands for."""
    if isinstance(value, list | tuple):
        return "".join(perform(part, given) for part in value)
    return value.perform(given) if hasattr(value, "perform") else str(value)


def modules(log_folder):
    """Module name -> stand-in. What the launch files leave for the nodes goes to `log_folder`."""
    made = {}
    for name, classes in FACTS["classes"].items():
        made[name] = types.ModuleType(name)
        for class_name, taken in classes.items():
            base = _WITH_MEANING.get(class_name, Stub)
            setattr(made[name], class_name, type(class_name, (base,), {"taken": tuple(taken)}))
    for name in [*made, "launch.logging"]:
        parent = name.rpartition(".")[0]
        if parent:
            made.setdefault(parent, types.ModuleType(parent))
    made["launch.logging"] = types.ModuleType("launch.logging")
    made["launch.logging"].launch_config = types.SimpleNamespace(
        get_log_file_path=lambda name: str(Path(log_folder) / name)
    )
    made["launch"].logging = made["launch.logging"]
    return made


def load(name):
    """The launch description of a file."""
    path = PACKAGE / "launch" / f"{name}.launch.py"
    spec = importlib.util.spec_from_file_location(f"{name}_launch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.generate_launch_description()


class Launched:
    """What a launch has done so far.

    started: (package, executable) -> performed arguments of the node or launch file; kinds: executable -> class of its
    action; ran: the command lines of other processes, which end well; said: what was logged.
    """

    def __init__(self):
        self.started, self.ran, self.said, self.kinds = {}, [], [], {}

    def carry_out(self, name, **given):
        """Carry a launch file out with these arguments; returns `started`."""
        context = types.SimpleNamespace(launch_configurations=given, is_shutdown=False)
        actions = list(load(name).args[0])
        while actions:
            action = actions.pop(0)
            if not action.wanted(given):
                continue
            actions = [*self._visit(action, context), *actions]
        return self.started

    def _visit(self, action, context):
        given, kind, kwargs = context.launch_configurations, type(action).__name__, action.kwargs
        if kind == "DeclareLaunchArgument":
            given.setdefault(action.args[0], kwargs["default_value"])
            choices = kwargs.get("choices")
            assert not choices or given[action.args[0]] in choices
        elif kind == "SetLaunchConfiguration":
            given[action.args[0]] = action.args[1]
        elif kind == "OpaqueFunction":
            return kwargs["function"](context, *kwargs.get("args", [])) or []
        elif kind in ("Node", "LifecycleNode"):
            key = kwargs["package"], kwargs["executable"]
            self.started[key], self.kinds[key[1]] = _performed(kwargs, context), kind
        elif kind == "IncludeLaunchDescription":
            (location,) = action.args[0].args
            arguments = {key: perform(value, given) for key, value in kwargs.get("launch_arguments", ())}
            if isinstance(location, str):
                self.carry_out(Path(location).name.removesuffix(".launch.py"), **{**given, **arguments})
            else:
                package, *inside = location.args[0]
                self.started[package.args[0], "/".join(inside)] = arguments
        elif kind == "ExecuteProcess":
            program, *arguments = kwargs["cmd"]
            assert (program.args[1], program.args[0]) in executables_of_setup_py()
            self.ran.append([perform(one, given) for one in arguments])
            following = kwargs["on_exit"](ended(0), context) or []
            return following if isinstance(following, list) else [following]
        elif kind == "LogInfo":
            self.said.append(kwargs["msg"])
        elif kind == "SetEnvironmentVariable":
            name, value = action.args
            assert value.args == (name,)  # what the user has set stays
        else:
            raise AssertionError(f"{kind} is not known to this test")
        return []


def _performed(kwargs, context):
    """The arguments of a node with what its substitutions stand for; respawn as a truth value."""
    given = context.launch_configurations
    done = {name: perform(kwargs[name], given) for name in ("namespace", "respawn") if name in kwargs}
    return {
        **kwargs,
        **done,
        "respawn": done.get("respawn") == "true",
        "arguments": [perform(one, given) for one in kwargs["arguments"]],
        "parameters": [one if isinstance(one, dict) else one.perform(context) for one in kwargs["parameters"]],
    }


def ended(returncode, name="node-1"):
    """The event of a process that has ended."""
    return types.SimpleNamespace(returncode=returncode, process_name=name)


def executables_of_setup_py():
    """(package, executable) of every entry point in the setup.py files."""
    found = set()
    for package in OURS:
        text = (ROOT / package / "setup.py").read_text()
        found |= {(package, name) for name in re.findall(r'"(\w+) = [\w.]+:\w+"', text)}
    return found


def installation(folder, packages=OTHERS):
    """An installation prefix in `folder` in which these packages are found."""
    index = Path(folder) / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    for package in packages:
        (index / package).touch()
    return str(folder)
