"""The Dockerfile and what it takes in, against the tree. Nothing is built here."""

import json
import re
import subprocess
import xml.etree.ElementTree as ElementTree
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
DOCKER = ROOT / "docker"
if not DOCKER.is_dir():
    pytest.skip("the container files are only in the source tree", allow_module_level=True)
FINAL = ("cpu", "dev", "gpu")


def read_stages():
    """Stage name -> (its base, [(instruction, argument)]), in order."""
    text = re.sub(r"^\s*#.*\n", "", (DOCKER / "Dockerfile").read_text(), flags=re.M).replace("\\\n", " ")
    defaults, stages, current = {}, {}, None
    for line in filter(None, map(str.strip, text.splitlines())):
        word, _, rest = line.partition(" ")
        if word == "FROM":
            base, name = re.fullmatch(r"(\S+) AS (\S+)", rest).groups()
            base = re.sub(r"\$\{(\w+)\}", lambda m: defaults[m[1]], base)
            current = stages.setdefault(name, (base, []))
        elif current is None and word == "ARG":
            name, _, value = rest.partition("=")
            defaults[name] = value
        else:
            current[1].append((word, " ".join(rest.split())))
    return stages


STAGES = read_stages()


def history(stage):
    """The instructions of a stage after those of its bases."""
    base, own = STAGES[stage]
    return (history(base) if base in STAGES else []) + own


@pytest.mark.parametrize("stage", STAGES)
def test_bases_are_stages_or_tagged_images(stage):
    base, _ = STAGES[stage]
    assert base in STAGES or re.fullmatch(r"ros:jazzy-ros-base-noble(@sha256:[0-9a-f]{64})?", base)


@pytest.mark.parametrize("stage", FINAL)
def test_final_images_run_as_a_user_who_is_not_root(stage):
    users = [argument for word, argument in history(stage) if word == "USER"]
    assert users[-1] not in ("root", "0")
    assert any("useradd" in argument for word, argument in history(stage) if word == "RUN")


@pytest.mark.parametrize("stage", ["cpu", "gpu"])
def test_final_images_report_their_health(stage):
    checks = [argument for word, argument in history(stage) if word == "HEALTHCHECK"]
    assert "healthcheck.py" in checks[-1]


@pytest.mark.parametrize("name", ["requirements.txt", "requirements-gpu.txt", "constraints.txt"])
def test_python_packages_are_pinned(name):
    lines = [line for line in (DOCKER / name).read_text().splitlines() if line and not line.startswith("#")]
    assert lines
    assert all(re.fullmatch(r"[\w.-]+(\[[\w,]+\])?==[\w.]+", line) for line in lines)


@pytest.mark.parametrize(
    ("pins", "tested"), [("requirements.txt", ["base.txt", "dev.txt"]), ("requirements-gpu.txt", ["train.txt"])]
)
def test_pins_are_those_the_tests_run_with(pins, tested):
    lines = [line for name in tested for line in (ROOT / "tools" / "requirements" / name).read_text().splitlines()]
    known = {line.split(" ;")[0] for line in lines if "python_version < " not in line}
    assert {line for line in (DOCKER / pins).read_text().splitlines() if line and line[0] != "#"} <= known


def in_the_build_context(path):
    """Whether .dockerignore, whose patterns apply one after the other, leaves a path of the workspace in."""
    kept = True
    for line in (ROOT / ".dockerignore").read_text().splitlines():
        if line and not line.startswith("#") and fnmatch(path.split("/")[0], line.removeprefix("!")):
            kept = line.startswith("!")
    return kept


def test_every_package_is_built_and_the_rest_stays_out():
    for stage, copied in (("manifests", ". ."), ("build", ". src")):
        assert ("COPY", copied) in STAGES[stage][1]
    packages = [path.parent.name for path in ROOT.glob("*/package.xml")]
    assert len(packages) >= 5
    assert all(in_the_build_context(package) for package in packages)
    assert not any(in_the_build_context(name) for name in (".git", ".venv", "out", "reports", "tests", "tools"))


def test_what_is_copied_exists_and_is_in_the_build_context():
    for _, own in STAGES.values():
        for word, argument in own:
            parts = [part for part in argument.split() if not part.startswith("--")]
            if word == "COPY" and "--from" not in argument and parts[0] != ".":
                for source in parts[:-1]:
                    assert (ROOT / source).exists(), source
                    assert in_the_build_context(source), source


def test_what_pip_is_to_install_is_pinned():
    facts = yaml.safe_load((ROOT / "tests" / "facts" / "rosdep.yaml").read_text())
    wanted = set()
    for manifest in ROOT.glob("*/package.xml"):
        wanted |= {child.text for child in ElementTree.parse(manifest).getroot() if child.tag.endswith("depend")}
    assert {key for key in wanted if key.startswith("python3-")} <= {*facts["pip"], *facts["apt"]}
    pinned = {line.split("==")[0] for line in (DOCKER / "requirements.txt").read_text().splitlines()}
    assert {facts["pip"][key] for key in wanted & facts["pip"].keys()} <= pinned


# all that the shell lines call
PROGRAMS = {
    *("apt-get", "rosdep", "pip", "python3", "set", "."),
    *("find", "install", "mkdir", "rm", "groupadd", "useradd", "userdel"),
}


@pytest.mark.parametrize("stage", STAGES)
def test_setup_files_are_sourced_where_unset_variables_are_allowed(stage):
    """They read some that nobody has set (tests/facts/setup_files.yaml)."""
    for word, argument in STAGES[stage][1]:
        if word == "SHELL":
            assert json.loads(argument) == ["/bin/bash", "-euo", "pipefail", "-c"]
        if word == "RUN":
            assert {part.split()[0] for part in argument.split(" && ")} <= PROGRAMS
        assert re.fullmatch(r"(?:set \+u && \. \S+/setup\.bash && set -u && )?((?!setup\.bash).)*", argument)
    entrypoint = (DOCKER / "entrypoint.sh").read_text().splitlines()
    assert entrypoint[0] == "#!/usr/bin/env bash"
    assert entrypoint[-4:-1] == ["set -e", *(f"source /opt/{of}/setup.bash" for of in ("ros/jazzy", "midastouch"))]


def test_colcon_runs_in_the_environment_that_pip_has_filled():
    """What it installs starts with the Python that runs it; that of /usr/bin/colcon has none of pip's packages."""
    installed = yaml.safe_load((ROOT / "tests" / "facts" / "install.yaml").read_text())
    assert installed["interpreter"].startswith("the Python that ran colcon")
    (environment,) = (argument for word, argument in STAGES["dependencies"][1] if word == "ENV")
    assert "PATH=/opt/venv/bin:${PATH}" in environment
    assert any("python3 -m venv --system-site-packages /opt/venv && pip install" in a for _, a in history("build"))
    assert any("&& python3 -m colcon build " in argument for _, argument in STAGES["build"][1])


def test_scripts_are_executable_and_the_entrypoint_ends_in_exec():
    for name in ("entrypoint.sh", "healthcheck.py"):
        assert (DOCKER / name).stat().st_mode & 0o111
    subprocess.run(["bash", "-n", DOCKER / "entrypoint.sh"], check=True)
    assert (DOCKER / "entrypoint.sh").read_text().endswith('exec "$@"\n')


def test_the_set_up_with_a_system_ros_is_that_of_the_image():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    block = re.search(r"^## With a system ROS 2.*?^```\n(.*?)^```", text, flags=re.M | re.S)[1]
    commands = [part for line in block.splitlines() for part in line.split("#")[0].strip().split(" && ")]
    apt, rosdep, venv, _, pip, build, _, check, result = commands[1:]
    assert apt.startswith("sudo apt install python3-venv ")
    assert rosdep == "rosdep install --from-paths . --ignore-src -y"
    assert venv == "python3 -m venv --system-site-packages ~/midastouch"
    assert pip == "pip install -r docker/requirements.txt -c docker/constraints.txt"
    assert (build, check) == ("python3 -m colcon build --symlink-install", "python3 -m colcon test")
    assert result.startswith("colcon test-result")
