"""Write tools/requirements/lock.txt: every package of the set-up, dependencies included, pinned by version and content.

Run it after changing a requirement file, with one interpreter of each supported Python version:

    .venv/bin/python tools/lock_requirements.py python3.10 python3.11 python3.12 python3.13
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

TOOLS = Path(__file__).resolve().parent
SOURCES = [
    TOOLS / "ros_wheels" / "run.txt",
    TOOLS / "ros_wheels" / "build.txt",
    TOOLS / "requirements" / "base.txt",
    TOOLS / "requirements" / "dev.txt",
]
LOCK = TOOLS / "requirements" / "lock.txt"
# The one package without a wheel; it is pure Python.
SOURCE_ONLY = "empy"
HEADER = f"""\
# Written by tools/lock_requirements.py: do not edit.
--only-binary :all:
--no-binary {SOURCE_ONLY}
"""


def resolve(interpreter: str, constraints: list[str]) -> tuple[str, dict[str, tuple[str, str]]]:
    """Let pip resolve the requirement files: returns the Python version "3.x" and {package: (version, SHA-256)}."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        pins = Path(folder) / "constraints.txt"
        pins.write_text("\n".join(constraints))
        command = [sys.executable, "-m", "pip", "--python", interpreter, "install", "--quiet", "--dry-run"]
        command += ["--ignore-installed", "--only-binary", ":all:", "--no-binary", SOURCE_ONLY]
        command += ["--report", str(report), "--constraint", str(pins)]
        command += [option for source in SOURCES for option in ("--requirement", str(source))]
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("interpreters", nargs="+", help="one Python of each supported version, oldest first")
    versions: dict[str, dict[str, list[str]]] = {}
    sums: dict[tuple[str, str], set[str]] = {}
    newest: dict[str, str] = {}
    for interpreter in parser.parse_args().interpreters:
        # Later versions get what Python 3.11 gets: fewer combinations to test.
        # Python 3.10 is the exception, as several packages have dropped it.
        python, packages = resolve(interpreter, [f"{name}=={version}" for name, version in newest.items()])
        if python != "3.10":
            newest.update({name: version for name, (version, _) in packages.items()})
        for name, (version, digest) in packages.items():
            sums.setdefault((name, version), set()).add(digest)
            versions.setdefault(name, {}).setdefault(version, []).append(python)
        print(f"Python {python}: {len(packages)} packages")
    pythons = {python for chosen in versions.values() for users in chosen.values() for python in users}
    lines = []
    for name in sorted(versions, key=str.lower):
        for version, users in versions[name].items():
            marker = " or ".join(f'python_version == "{python}"' for python in users)
            hashes = "".join(f" --hash=sha256:{digest}" for digest in sorted(sums[name, version]))
            lines.append(f"{name}=={version}" + (f" ; {marker}" if set(users) != pythons else "") + hashes)
    LOCK.write_text(HEADER + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
