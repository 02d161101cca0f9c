"""Write tools/requirements/lock_*.txt, one for each ROS distribution of tools/ros_wheels: every package of the set-up,
dependencies included, pinned by version and content. docs_lock.txt has what `make docs` installs in addition.

Run it after changing a requirement file, with one interpreter of each supported Python version:

    .venv/bin/python tools/lock_requirements.py python3.10 python3.11 python3.12 python3.13
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

TOOLS = Path(__file__).resolve().parent
DISTRIBUTIONS = sorted((TOOLS / "ros_wheels").glob("*.txt"))
LIBRARIES = [TOOLS / "requirements" / "base.txt", TOOLS / "requirements" / "dev.txt"]
DOCS = TOOLS / "requirements" / "docs.txt"
# The one package without a wheel; it is pure Python.
SOURCE_ONLY = "empy"
FILES = ["--only-binary", ":all:", "--no-binary", SOURCE_ONLY]
HEADER = f"""\
# Written by tools/lock_requirements.py: do not edit.
{" ".join(FILES[:2])}
{" ".join(FILES[2:])}
"""
# The oldest glibc that all libraries have wheels for, and older ones, whose wheels run there, too. 2014 is an alias of
# 2_17, which pip does not resolve here.
GLIBCS = ("_2_28", "_2_27", "_2_17", "2014")
ARM64 = [option for glibc in GLIBCS for option in ("--platform", f"manylinux{glibc}_aarch64")]
# Packages with wheels for x86-64 only, by the beginnings of their names: ROS, and a library that only our tests need.
ONLY_X86_64 = ("ros-", "ur_rtde")


def ask_pip(interpreter: str, options: list[str], requirements: list[str]) -> tuple[str, dict[str, tuple[str, str]]]:
    """Return what pip would install: the Python version "3.x" and {package: (version, SHA-256)}."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        named = Path(folder) / "requirements.txt"
        named.write_text("\n".join(requirements))
        command = [sys.executable, "-m", "pip", "--python", interpreter, "install", "--quiet", "--dry-run"]
        command += ["--ignore-installed", *FILES, "--report", str(report), *options, str(named)]
        subprocess.run(command, check=True)
        result = json.loads(report.read_text())
    packages = {
        item["metadata"]["name"]: (
            item["metadata"]["version"],
            item["download_info"]["archive_info"]["hashes"]["sha256"],
        )
        for item in result["install"]
    }
    return result["environment"]["python_version"], packages


def lock(files: list[Path], interpreters: list[str], installed: list[str]) -> str:
    """Return the lines of the lock of these requirement files: what has to be added to the `installed` pins."""
    known = {normalised(pin.partition("==")[0]) for pin in installed}
    versions: dict[str, dict[str, list[str]]] = {}
    sums: dict[tuple[str, str], set[str]] = {}
    newest: list[str] = []
    sources = [option for source in files for option in ("--requirement", str(source))]
    for interpreter in interpreters:
        # Later versions get the packages of Python 3.11: fewer combinations to test.
        # Python 3.10 is the exception, as several packages have dropped it.
        python, packages = ask_pip(interpreter, [*sources, "--constraint"], installed + newest)
        packages = {name: chosen for name, chosen in packages.items() if normalised(name) not in known}
        exact = [f"{name}=={version}" for name, (version, _) in packages.items()]
        if python != "3.10":
            newest = exact
        libraries = [pin for pin in exact if not pin.startswith(ONLY_X86_64)]
        other_machine = [*ARM64, "--python-version", python, "--target", "unused", "--no-deps", "--requirement"]
        _, for_arm64 = ask_pip(interpreter, other_machine, libraries)
        for name, (version, digest) in [*packages.items(), *for_arm64.items()]:
            sums.setdefault((name, version), set()).add(digest)
        for name, (version, _) in packages.items():
            versions.setdefault(name, {}).setdefault(version, []).append(python)
        print(f"{files[0].stem}, Python {python}: {len(packages)} packages, {len(for_arm64)} on arm64")
    pythons = {python for chosen in versions.values() for users in chosen.values() for python in users}
    lines = []
    for name in sorted(versions, key=str.lower):
        for version, users in versions[name].items():
            markers = [] if set(users) == pythons else [" or ".join(f'python_version == "{p}"' for p in users)]
            markers += ['platform_machine == "x86_64"'] if name.startswith(ONLY_X86_64) else []
            marker = " and ".join(f"({m})" if " or " in m and len(markers) > 1 else m for m in markers)
            hashes = "".join(f" --hash=sha256:{digest}" for digest in sorted(sums[name, version]))
            lines.append(f"{name}=={version}" + (f" ; {marker}" if marker else "") + hashes)
    return HEADER + "\n".join(lines) + "\n"


def normalised(name: str) -> str:
    """Return the name of a package as PyPI compares names."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(text: str) -> list[str]:
    """Return the pins of a lock, without the hashes, which pip does not take in constraints."""
    return [line.partition(" --hash=")[0].strip() for line in text.splitlines() if "==" in line]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("interpreters", nargs="+", help="one Python of each supported version, oldest first")
    interpreters = parser.parse_args().interpreters
    for distribution in DISTRIBUTIONS:
        text = lock([distribution, *LIBRARIES], interpreters, installed=[])
        (TOOLS / "requirements" / f"lock_{distribution.stem}.txt").write_text(text)
    # The libraries are those of every distribution.
    DOCS.with_name("docs_lock.txt").write_text(lock([DOCS], interpreters, pins(text)))


if __name__ == "__main__":
    main()
