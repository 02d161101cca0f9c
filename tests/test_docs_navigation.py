"""Readers find their way: links lead somewhere, what is named exists, and what is to be read first is short."""

import ast
import re

import pytest
from documents import DOCUMENTS, ROOT, SPANS, section

TOP_FOLDERS = "|".join(
    sorted(
        {p.parent.name for p in ROOT.glob("*/package.xml")}
        | {"docker", "docs", "examples", "reports", "tests", "tools"}
    )
)


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
    walks = re.split(r"^\*\*.*\*\*$", section("docs/architecture.md", "## Four walks"), flags=re.M)[1:]
    assert len(walks) == 4
    for walk in walks:
        stations = re.findall(r"^\d\. \[[^\]]+\]\(\.\./([^)]+)\): `([\w.]+)`$", walk, flags=re.M)
        assert 1 < len(stations) <= 6
        for path, name in stations:
            assert name in defined_names((ROOT / path).read_text()), f"{path}: {name}"


def defined_names(source: str) -> set[str]:
    """Classes, functions and methods (`Class.method`) of a module."""
    kinds = ast.ClassDef | ast.FunctionDef
    top = [node for node in ast.parse(source).body if isinstance(node, kinds)]
    return {node.name for node in top} | {
        f"{node.name}.{inner.name}" for node in top for inner in node.body if isinstance(inner, kinds)
    }


def test_the_readme_is_short():
    assert len(DOCUMENTS["README.md"].encode()) <= 9000
