"""ROS stays in the nodes: everything else is plain Python that runs, and is tested, without it."""

import re
from pathlib import Path

import packages
import pytest
from packages import ROOT, imports, loaded_by, modules

# The two folders of a package that may know ROS: nodes, and the glue that several nodes share.
ROS_FOLDERS = {"nodes", "ros"}
ROS = re.compile(
    r"(rclpy|rcl_interfaces|rosidl\w*|tf2\w*|launch|launch_\w+|message_filters|cv_bridge|diagnostic_updater"
    r"|ament_index_python|builtin_interfaces|\w+_msgs|\w+_srvs|sensor_msgs_py|rosbag2_py)(\.|$)"
)
LEARNING = re.compile(r"(torch|torchvision|onnx|onnxruntime|onnxscript|openvino|tensorflow|jax)(\.|$)")


def core_files(package: str) -> list[Path]:
    return [path for path in modules(package).values() if not ROS_FOLDERS & set(path.relative_to(ROOT).parts)]


def offences(package: str, forbidden: re.Pattern) -> list[str]:
    return [
        f"{path.relative_to(ROOT)}:{line}: imports {module}"
        for path in core_files(package)
        for line, module, _ in imports(path)
        if forbidden.match(module)
    ]


@pytest.mark.parametrize("package", packages.WITH_MODULES)
def test_core_imports_no_ros(package):
    assert core_files(package)
    assert offences(package, ROS) == []


def needs_ros(path: Path) -> bool:
    """Whether a module imports ROS, or a module of those two folders, or what it is told to when it runs."""
    named = {f"{module}.{name}" for _, module, names in imports(path) for name in names or [""]}
    return any(ROS.match(one) or ROS_FOLDERS & set(one.split(".")) or one == "importlib." for one in named)


@pytest.mark.parametrize("package", packages.WITH_MODULES)
def test_what_needs_no_ros_is_outside_of_its_folders(package):
    ring = [path for path in {*modules(package).values()} - {*core_files(package)} if path.name != "__init__.py"]
    assert [str(path.relative_to(ROOT)) for path in ring if not needs_ros(path)] == []


def test_filter_imports_no_deep_learning_framework():
    assert offences("midastouch_filter", LEARNING) == []


def test_dependencies_between_packages_point_inward():
    """Those earlier in the list may be imported, but the driver and perception not by each other."""
    order = [*packages.CMAKE, *packages.PYTHON]
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: imports {module}"
        for package in packages.PYTHON
        for path in modules(package).values()
        for line, module, _ in imports(path)
        if module.split(".")[0] in order[order.index(package) + 1 :]
        or (package == "midastouch_perception" and module.split(".")[0] == "digit_driver")
    ]
    assert wrong == []


def test_filter_runs_without_ros_and_without_learning_framework():
    """What the scan cannot see: an import of an import."""
    core = {*core_files("midastouch_filter")}
    names = [name for name, path in modules("midastouch_filter").items() if path in core and "__main__" not in name]
    loaded = loaded_by(f"import importlib\nfor name in {names}: importlib.import_module(name)")
    assert "numpy" in loaded
    assert [name for name in loaded if ROS.match(name) or LEARNING.match(name)] == []


def test_the_scan_sees_what_it_should(tmp_path):
    source = tmp_path / "core.py"
    source.write_text(
        "import numpy\nfrom sensor_msgs.msg import Image\n"
        "def late():\n    import tf2_ros.buffer\n    from . import msgs\n"
    )
    assert [line for line, module, _ in imports(source) if ROS.match(module)] == [2, 4]
    assert not ROS.match("midastouch_filter")
