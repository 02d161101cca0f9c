"""The requirement files and the lock that set-up installs agree."""

import re

import pytest
import yaml

SUPPORTED = ["3.10", "3.11", "3.12", "3.13"]
SOURCES = ["ros_wheels/run.txt", "ros_wheels/build.txt", "requirements/base.txt", "requirements/dev.txt"]


def pins(path, python: str) -> dict[str, str]:
    """{normalised name: version} of the lines that hold for a Python version."""
    requirements = pytest.importorskip("packaging.requirements")
    utils = pytest.importorskip("packaging.utils")
    found = {}
    for line in path.read_text().splitlines():
        if not line or line.startswith(("#", "--")):
            continue
        requirement = requirements.Requirement(line.partition(" --hash=")[0])
        if requirement.marker and not requirement.marker.evaluate({"python_version": python}):
            continue
        (specifier,) = requirement.specifier
        assert specifier.operator == "==", line
        name = utils.canonicalize_name(requirement.name)
        assert name not in found, f"{name} twice for Python {python} in {path.name}"
        found[name] = specifier.version
    return found


@pytest.mark.parametrize("python", SUPPORTED)
@pytest.mark.parametrize("source", SOURCES)
def test_lock_holds_every_pin(root, source, python):
    wanted = pins(root / "tools" / source, python)
    locked = pins(root / "tools" / "requirements" / "lock.txt", python)
    assert wanted
    assert wanted.items() <= locked.items()


@pytest.mark.parametrize("python", SUPPORTED)
def test_base_install_has_no_torch(root, python):
    locked = pins(root / "tools" / "requirements" / "lock.txt", python)
    assert not {"torch", "open3d"} & locked.keys()


def test_every_package_is_locked_by_its_content(root):
    """One line without a sum, and pip takes whatever the index serves under that name."""
    lines = (root / "tools" / "requirements" / "lock.txt").read_text().splitlines()
    packages = [line for line in lines if "==" in line]
    assert len(packages) > 100
    assert [line for line in packages if not re.search(r"( --hash=sha256:[0-9a-f]{64})+$", line)] == []


def test_a_system_ros_on_ubuntu_is_new_enough(root):
    """pytest of the distribution runs `colcon test`; what ROS is compiled against may not be replaced by pip."""
    noble = yaml.safe_load((root / "tests" / "facts" / "noble.yaml").read_text())
    wanted = re.search(r'^minversion = "([\d.]+)"', (root / "pyproject.toml").read_text(), flags=re.M)[1]
    assert [int(part) for part in wanted.split(".")] <= [int(part) for part in noble["python3-pytest"].split(".")]
    kept = pins(root / "docker" / "constraints.txt", "3.12")
    assert kept == {name: noble[f"python3-{name}"] for name in ("numpy", "scipy")}
