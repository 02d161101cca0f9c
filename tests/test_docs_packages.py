"""Packages, what they depend on and the Python they want, as the documents tell it."""

import importlib.metadata
import re
import sys

from documents import DOCUMENTS, ROOT, table

from midastouch_tools.machine import KNOWN


def test_every_package_is_in_the_table():
    packages = {p.parent.name for p in ROOT.glob("*/package.xml")}
    assert {re.search(r"`(\w+)`", row[0])[1] for row in table("README.md", "## Packages")} == packages
    assert all(f"{name}/README.md" in DOCUMENTS for name in packages)


def test_every_dependency_is_listed_with_its_licence():
    rows = {re.split(r"[ (]", row[0])[0].lower(): row for row in table("docs/dependencies.md", "# Dependencies")}
    listed = {re.sub(r".*\((\S+)\)", r"\1", row[0]).lower().replace(" ", "") for row in rows.values()}
    pinned = re.findall(r"^([\w-]+)==", (ROOT / "tools/requirements/base.txt").read_text(), flags=re.M)
    assert {name.lower().replace("-", "") for name in pinned} <= {name.replace("-", "") for name in listed}
    for row in rows.values():
        assert len(row) == 3
        assert all(row)


def test_distributions_are_what_doctor_calls_them():
    """And only those with wheels can be tested."""
    rows = {row[0].split()[0]: row[1:] for row in table("docs/platforms.md", "## Distributions of ROS 2")}
    wheels = {path.stem.title() for path in (ROOT / "tools" / "ros_wheels").glob("*.txt")}
    assert {name for name, (state, _) in rows.items() if state == "tested"} == wheels
    for beginning, (name, said) in KNOWN.items():
        state, known = rows[name]
        assert said.startswith(state)
        assert f"{beginning[:-1]}." in known


def test_python_versions_are_those_of_the_packages():
    assert "Python 3.10 to 3.13" in " ".join(DOCUMENTS["README.md"].split())
    assert importlib.metadata.metadata("midastouch_tools")["Requires-Python"] == ">=3.10"
    assert sys.version_info >= (3, 10)
