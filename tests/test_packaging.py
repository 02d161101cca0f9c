"""package.xml, setup.py and setup.cfg: what rosdep, colcon and `ros2 run` need, and no more."""

import ast
import functools
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from configparser import ConfigParser
from pathlib import Path

import packages
import pytest
import yaml
from ament_index_python.packages import get_package_share_directory
from packages import imports

from midastouch_common.missing_modules import DISTRIBUTIONS as DISTRIBUTIONS_OF_PIP

ROOT = Path(__file__).resolve().parent.parent
PYTHON_PACKAGES, CMAKE_PACKAGES = packages.PYTHON, packages.CMAKE
PACKAGES = [*CMAKE_PACKAGES, *PYTHON_PACKAGES]

# Imported module -> rosdep key, for modules whose key is not their own name.
ROSDEP_KEYS = {
    **{name: f"python3-{name}" for name in ("matplotlib", "numpy", "pandas", "pyudev", "scipy", "tabulate", "tqdm")},
    **{name: f"python3-{name}-pip" for name in ("onnxruntime", "rosbags", "trimesh")},
    "cv2": "python3-opencv", "PIL": "python3-pil", "sklearn": "python3-sklearn", "tf2_ros": "tf2_ros_py",
    "yaml": "python3-yaml",
}  # fmt: skip
# rosdep has no key for these; the Dockerfile and CONTRIBUTING.md install them with pip.
PIP_ONLY = {"igl", "mcap", "pykdtree", "simplejpeg"}
# Extras, imported where they are used and said to be missing there.
OPTIONAL = {
    "distributed", "h5py", "libusb_package", "mujoco", "onnx", "onnxscript", "open3d", "openvino", "pyarrow", "rerun",
    "rerun_cli", "rtde_control", "rtde_receive", "safetensors", "torch",
}  # fmt: skip
# Imported module -> its distribution on PyPI, where the names differ.
DISTRIBUTIONS = {
    "cv2": "opencv-contrib-python-headless", "PIL": "pillow", "igl": "libigl", "libusb_package": "libusb-package",
    "open3d": "open3d-cpu", "rerun": "rerun-sdk", "rerun_cli": "rerun-sdk", "rtde_control": "ur-rtde",
    "rtde_receive": "ur-rtde", "sklearn": "scikit-learn", "yaml": "PyYAML",
}  # fmt: skip
WHEEL = ["midastouch_kernels", *(set(PYTHON_PACKAGES) - {"digit_driver", "midastouch_benchmark"})]
PROJECT = (ROOT / "pyproject.toml").read_text()
SYSTEM_KEYS = {"robot_state_publisher", "rviz2", "v4l-utils", "xacro"}


def manifest(package: str) -> ElementTree.Element:
    return ElementTree.parse(ROOT / package / "package.xml").getroot()


def texts(element: ElementTree.Element, *tags: str) -> list[str]:
    return [child.text for tag in tags for child in element.findall(tag)]


@functools.cache
def imported_modules(package: str) -> set[str]:
    """Top-level names that a package imports from outside the standard library and itself."""
    files = [*(ROOT / package / package).rglob("*.py"), *(ROOT / package).glob("launch/*.py")]
    names = {module.split(".")[0] for path in files for _, module, _ in imports(path)}
    return names - set(sys.stdlib_module_names) - {package}


def launched_packages(package: str) -> set[str]:
    """Packages of ours that the launch files of a package name, except those that a robot does without."""
    constants = {
        node.value
        for path in (ROOT / package).glob("launch/*.py")
        for node in ast.walk(ast.parse(path.read_text(), str(path)))
        if isinstance(node, ast.Constant)
    }
    return constants & {*PACKAGES} - {package, "midastouch_simulation", "midastouch_tools"}


@pytest.mark.parametrize("package", PACKAGES)
def test_manifest_is_complete(package):
    root = manifest(package)
    assert root.get("format") == "3"
    assert texts(root, "name") == [package]
    assert texts(root, "license") == ["MIT"]
    assert (ROOT / package / root.find("license").get("file")).read_bytes() == (ROOT / "LICENSE").read_bytes()
    build_type = root.find("export/build_type").text
    assert build_type == ("ament_cmake" if package in CMAKE_PACKAGES else "ament_python")
    dependencies = texts(root, "depend", "exec_depend")
    assert dependencies == sorted(set(dependencies)) or package == "midastouch_msgs"
    groups = ["rosidl_interface_packages"] if package == "midastouch_msgs" else []
    assert texts(root, "member_of_group") == groups
    # bloom would take a pip package for a Debian package of that name; what reads the environment it leaves out
    of_pip = [child for child in root if (child.text or "").endswith("-pip")]
    assert {child.get("condition") for child in of_pip} <= {"$PIP_BREAK_SYSTEM_PACKAGES == 1"}


def test_version_and_maintainer_are_those_of_pyproject(load_tool):
    tool = load_tool("stamp_release")
    assert len(tool.STAMPED) > len(PACKAGES) + 2
    differing = [path for path in tool.STAMPED if tool.stamped(path.read_text(), PROJECT) != path.read_text()]
    assert differing == [], "call tools/stamp_release.py"


def test_a_release_is_stamped_wherever_it_is_named(load_tool):
    project = 'version = "1.2.0"\nmaintainers = [{ name = "Tip & Go", email = "a@b.org" }]\n'
    before = '<?xml version="1.0"?>\n<version>0.1.0</version>\n<maintainer email="x@y.org">X</maintainer>\n'
    after = '<?xml version="1.0"?>\n<version>1.2.0</version>\n<maintainer email="a@b.org">Tip &amp; Go</maintainer>\n'
    stamped = load_tool("stamp_release").stamped
    assert stamped(before, project) == after
    assert stamped("cff-version: 1.2.0\nversion: 0.1.0\n", project) == "cff-version: 1.2.0\nversion: 1.2.0\n"
    assert stamped("image: midastouch:0.1.0-cpu\n", project) == "image: midastouch:1.2.0-cpu\n"


def test_one_version_in_pip_and_changelog():
    version = re.search(r'^version = "(.*)"$', PROJECT, flags=re.M)[1]
    assert {importlib.metadata.version(package) for package in PYTHON_PACKAGES} == {version}
    assert re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), flags=re.M)[1] == version


def test_what_only_pip_has_is_named_where_it_is_missing():
    lines = (ROOT / "docker" / "requirements.txt").read_text().splitlines()
    installed = {line.split("==")[0] for line in lines if "==" in line}
    # too old in Ubuntu, to build, optional
    assert installed - {"matplotlib", "nanobind", "onnx"} == set(DISTRIBUTIONS_OF_PIP.values())
    of_pip = PIP_ONLY | {name for name, key in ROSDEP_KEYS.items() if key.endswith("-pip")}
    assert of_pip == DISTRIBUTIONS_OF_PIP.keys()


def test_the_wheel_holds_and_wants_what_its_packages_do():
    packed = re.search(r"^wheel.packages = \[\n(.*?)^\]", PROJECT, flags=re.M | re.S)[1]
    assert re.findall(r'"(.*)"', packed) == [f"{package}/{package}" for package in sorted(WHEEL)]
    wanted = {name for package in WHEEL[1:] for name in declared_for_pip(package)["always"]} - {*PACKAGES}
    declared = re.search(r"^dependencies = \[\n(.*?)^\]", PROJECT, flags=re.M | re.S)[1]
    assert set(re.findall(r'"(.*)"', declared)) == wanted


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_every_import_is_declared_and_every_declaration_used(package):
    declared = set(texts(manifest(package), "exec_depend")) - SYSTEM_KEYS
    imported = (imported_modules(package) | launched_packages(package)) - PIP_ONLY - OPTIONAL
    assert {ROSDEP_KEYS.get(name, name) for name in imported} == declared


def declared_for_pip(package: str) -> dict[str, set[str]]:
    """Distributions that a setup.py names in install_requires, and in all extras together, without versions."""
    nodes = ast.walk(ast.parse((ROOT / package / "setup.py").read_text()))
    (call,) = (node for node in nodes if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "setup")
    given = {word.arg: word.value for word in call.keywords}
    always, extras = (ast.literal_eval(given[word]) for word in ("install_requires", "extras_require"))
    lines = {"always": always, "extras": [line for extra in extras.values() for line in extra]}
    return {kind: {re.split(r"[<>=!~ ;\[]", line)[0] for line in some} for kind, some in lines.items()}


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_pip_is_told_every_import_and_nothing_else(package):
    """What ROS brings, pip does not have; tests' own libraries are extras."""
    key_of = {name: ROSDEP_KEYS.get(name, name) for name in imported_modules(package)}
    of_python = {name for name, key in key_of.items() if key.startswith("python3-") or name in PIP_ONLY}
    ours = imported_modules(package) & ({*PACKAGES} - {"midastouch_msgs"})
    declared = declared_for_pip(package)
    assert {DISTRIBUTIONS.get(name, name) for name in of_python | ours} == declared["always"]
    optional = {DISTRIBUTIONS.get(name, name) for name in imported_modules(package) & OPTIONAL}
    assert optional <= declared["extras"]


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_colcon_and_ros_find_the_package_and_its_executables(package):
    assert (ROOT / package / "resource" / package).is_file()
    config = ConfigParser()
    config.read(ROOT / package / "setup.cfg")
    assert config["develop"]["script_dir"] == config["install"]["install_scripts"] == f"$base/lib/{package}"
    scripts = importlib.metadata.distribution(package).entry_points.select(group="console_scripts")
    assert scripts or package in ("midastouch_common", "midastouch_benchmark")
    for script in scripts:
        assert callable(script.load()), script
    assert (Path(get_package_share_directory(package)) / "package.xml").is_file()
    assert (ROOT / "tools" / "ros_wheels" / "COLCON_IGNORE").is_file()


@pytest.mark.parametrize("linked", [False, True], ids=["copied", "linked"])
def test_midastouch_is_a_command_in_an_install(root, tmp_path, linked):
    """Installed as colcon does it: entry points lie where `ros2 run` looks, only bin/ comes to be on PATH."""
    facts = yaml.safe_load((root / "tests" / "facts" / "install.yaml").read_text())
    source, prefix = tmp_path / "source", tmp_path / "install"
    shutil.copytree(root / "midastouch_tools", source, ignore=shutil.ignore_patterns("test", "*.egg-info", "build"))
    command = [sys.executable, "setup.py", "-q", "install", "--prefix", str(prefix), "--record", str(tmp_path / "log")]
    command += ["--single-version-externally-managed"]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    scripts = prefix / facts["scripts"].format(package="midastouch_tools")
    assert {"replay", "recorder", "midastouch"} <= {path.name for path in scripts.iterdir()}
    on_path = prefix / facts["path"]
    assert [path.name for path in on_path.iterdir()] == ["midastouch"]
    if linked:
        (on_path / "midastouch").unlink()
        (on_path / "midastouch").symlink_to(source / "scripts" / "midastouch")
    environment = {**os.environ, "PATH": f"{on_path}{os.pathsep}{os.environ['PATH']}"}
    run = subprocess.run("midastouch doctor --help", shell=True, env=environment, capture_output=True, text=True)
    assert run.stdout.startswith("usage: midastouch doctor"), run.stderr
