"""The requirement files and the lock that set-up installs agree."""

import re

import pytest
import yaml

SUPPORTED = ["3.10", "3.11", "3.12", "3.13"]
LIBRARIES = ["requirements/base.txt", "requirements/dev.txt"]
DISTRIBUTIONS = ["jazzy", "kilted"]


def pins(path, python: str, machine: str = "x86_64") -> dict[str, str]:
    """{normalised name: version} of the lines that hold for a Python version on a machine."""
    requirements = pytest.importorskip("packaging.requirements")
    utils = pytest.importorskip("packaging.utils")
    found = {}
    for line in path.read_text().splitlines():
        if not line or line.startswith(("#", "--")):
            continue
        requirement = requirements.Requirement(line.partition(" --hash=")[0])
        where = {"python_version": python, "platform_machine": machine}
        if requirement.marker and not requirement.marker.evaluate(where):
            continue
        (specifier,) = requirement.specifier
        assert specifier.operator == "==", line
        name = utils.canonicalize_name(requirement.name)
        assert name not in found, f"{name} twice for Python {python} in {path.name}"
        found[name] = specifier.version
    return found


def lock(root, distribution: str):
    return root / "tools" / "requirements" / f"lock_{distribution}.txt"


def test_there_is_a_lock_for_every_distribution_with_wheels(root):
    assert sorted(path.stem for path in (root / "tools" / "ros_wheels").glob("*.txt")) == DISTRIBUTIONS
    assert sorted(lock(root, "*").parent.glob("lock_*.txt")) == [lock(root, name) for name in DISTRIBUTIONS]


@pytest.mark.parametrize("python", SUPPORTED)
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_lock_holds_every_pin(root, distribution, python):
    locked = pins(lock(root, distribution), python)
    for source in (f"ros_wheels/{distribution}.txt", *LIBRARIES):
        wanted = pins(root / "tools" / source, python)
        assert wanted
        assert wanted.items() <= locked.items()


@pytest.mark.parametrize("python", SUPPORTED)
def test_make_docs_adds_what_it_needs_and_replaces_nothing(root, python):
    folder = root / "tools" / "requirements"
    added = pins(folder / "docs_lock.txt", python)
    assert pins(folder / "docs.txt", python).items() <= added.items()
    for distribution in DISTRIBUTIONS:
        assert not added.keys() & pins(lock(root, distribution), python).keys()
    assert added.keys() == pins(folder / "docs_lock.txt", python, "aarch64").keys()


@pytest.mark.parametrize("python", SUPPORTED)
def test_distributions_differ_in_ros_alone_and_bring_no_torch(root, python):
    """What makes estimates is the same, and so are they. ROS names the libraries that its build tools need."""
    jazzy, kilted = (
        {name: version for name, version in pins(lock(root, distribution), python).items() if name[:4] != "ros-"}
        for distribution in DISTRIBUTIONS
    )
    assert jazzy == kilted
    assert not {"torch", "open3d"} & jazzy.keys()


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_arm64_has_all_but_ros(root, distribution):
    for python in SUPPORTED:
        here, there = (pins(lock(root, distribution), python, machine).keys() for machine in ("x86_64", "aarch64"))
        assert there <= here
        assert {name for name in here - there if not name.startswith("ros-")} <= {"ur-rtde"}
        assert not any(name.startswith("ros-") for name in there)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_every_package_is_locked_by_its_content(root, distribution):
    """One line without a sum, and pip takes whatever the index serves under that name."""
    lines = lock(root, distribution).read_text().splitlines()
    packages = [line for line in lines if "==" in line]
    assert len(packages) > 100
    packages += [line for line in (root / "tools/requirements/docs_lock.txt").read_text().splitlines() if "==" in line]
    assert [line for line in packages if not re.search(r"( --hash=sha256:[0-9a-f]{64})+$", line)] == []


def test_a_system_ros_on_ubuntu_is_new_enough(root):
    """pytest of the distribution runs `colcon test`; what ROS is compiled against may not be replaced by pip."""
    noble = yaml.safe_load((root / "tests" / "facts" / "noble.yaml").read_text())
    wanted = re.search(r'^minversion = "([\d.]+)"', (root / "pyproject.toml").read_text(), flags=re.M)[1]
    assert [int(part) for part in wanted.split(".")] <= [int(part) for part in noble["python3-pytest"].split(".")]
    kept = pins(root / "docker" / "constraints.txt", "3.12")
    assert kept == {name: noble[f"python3-{name}"] for name in ("numpy", "scipy")}
