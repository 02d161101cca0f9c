"""Readers find their way: links lead somewhere, what is named exists, and what is to be read first is short."""

import ast
import re
from pathlib import Path

import packages
import pytest
import yaml
from documents import DOCUMENTS, ROOT, SPANS, section, table

TOP_FOLDERS = "|".join([*packages.CMAKE, *packages.PYTHON, "docker", "docs", "examples", "reports", "tests", "tools"])


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document):
    for target in re.findall(r"\]\(([^)]+)\)", DOCUMENTS[document]):
        if target.startswith("https://"):
            continue
        name, _, heading = target.partition("#")
        path = (ROOT / document).parent / name if name else ROOT / document
        assert path.exists(), target
        if heading:
            assert heading in anchors(path.read_text()), target


def anchors(text: str) -> set[str]:
    """What GitHub calls the headings of a document."""
    headings = re.findall(r"^#+ (.*)$", text, flags=re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_files_that_are_named_exist():
    """By their path in the tree, or as Python names them, without the package's outer folder."""
    paths = {span for span in SPANS if re.fullmatch(rf"({TOP_FOLDERS})/[\w./-]+", span)}
    assert len(paths) > 5
    candidates = {path: (ROOT / path, ROOT / path.split("/")[0] / path) for path in sorted(paths)}
    assert [path for path, places in candidates.items() if not any(place.exists() for place in places)] == []


def test_walks_are_short_and_name_what_is_there():
    walks = re.split(r"^\*\*.*\*\*$", section("docs/architecture.md", "## Six walks"), flags=re.M)[1:]
    assert len(walks) == 6
    for walk in walks:
        stations = re.findall(r"^\d\. \[[^\]]+\]\(\.\./([^)]+)\): `([\w.]+)`$", walk, flags=re.M)
        assert 1 < len(stations) <= 6
        for path, name in stations:
            assert name in defined_names(ROOT / path), f"{path}: {name}"


def defined_names(path: Path) -> set[str]:
    """Classes, functions, methods (`Class.method`) and constants of a module; keys of a YAML file."""
    if path.suffix == ".yaml":
        return set(yaml.safe_load(path.read_text()))
    kinds = ast.ClassDef | ast.FunctionDef
    statements = ast.parse(path.read_text()).body
    top = [node for node in statements if isinstance(node, kinds)]
    constants = {ast.unparse(target) for node in statements if isinstance(node, ast.Assign) for target in node.targets}
    return (
        constants
        | {node.name for node in top}
        | {f"{node.name}.{inner.name}" for node in top for inner in node.body if isinstance(inner, kinds)}
    )


def test_every_room_is_in_the_table_and_the_readme_is_short():
    listed = {re.fullmatch(r"`(.*)`", row[0])[1] for row in table("docs/architecture.md", "## Rooms")}
    rooms = {
        path.parent.relative_to(ROOT / package).as_posix()
        for package in packages.PYTHON
        for path in (ROOT / package / package).glob("*/__init__.py")
    }
    assert {room for room in rooms - listed if room.split("/")[1] not in ("nodes", "ros")} == set()
    assert len(DOCUMENTS["README.md"].encode()) <= 7200, "the first page is short"


def test_every_tutorial_says_how_long_it_takes():
    tutorials = {name: text for name, text in DOCUMENTS.items() if name.startswith("docs/tutorials/")}
    assert len(tutorials) >= 9
    said = {name: re.findall(r"^\*\*Time\*\*: .*(minute|hour)", text, flags=re.M) for name, text in tutorials.items()}
    assert [name for name, times in said.items() if len(times) != 1] == []
