"""What programs write into the documents is what they would write now: figures, pictures, parameters."""

import re

import pytest
from documents import DOCUMENTS, ROOT, section, table
from PIL import Image

from midastouch_benchmark.tables import documents as tables
from midastouch_benchmark.tables import trust_plots
from midastouch_benchmark.tables.reports import stale
from midastouch_benchmark.tables.table import UNMEASURED
from midastouch_tools.ros.parameter_tables import markdown


@pytest.fixture(scope="module")
def old() -> list[str]:
    """Reports of the headline pages that earlier code made."""
    return stale(tables.headline())


@pytest.mark.parametrize("document", tables.DOCUMENTS)
def test_figures_are_those_of_the_reports(document):
    assert DOCUMENTS[document].count("<!-- table ") == DOCUMENTS[document].count("<!-- end -->") > 0
    assert DOCUMENTS[document] == tables.filled(document), f"run: python -m {tables.__name__}"


def test_the_figures_of_the_evaluation_stand_in_its_tables():
    tables_of_reports = DOCUMENTS["reports/README.md"] + DOCUMENTS["docs/trust.md"]
    figures = table("docs/evaluation.md", "## The figures")
    assert len(figures) >= 12
    shown = [(what, figure) for _, what, figure, _ in figures if figure != UNMEASURED]
    assert [what for what, figure in shown if f"| {figure} |" not in tables_of_reports] == []
    numbered = re.findall(r"^(\d+)\. \*\*", section("docs/evaluation.md", "## The figures"), flags=re.M)
    assert numbered == [number for number, *_ in figures]


def test_headline_pages_have_figures_of_one_fingerprint(old):
    """A row that names a report of other code than today's has no figure, or those of another report beside it."""
    for document in tables.HEADLINE:
        assert tables.MARK not in DOCUMENTS[document], f"{document}; run: python -m {tables.__name__}"
        for line in DOCUMENTS[document].splitlines():
            if line.startswith("|") and any(f"[{name}](" in line for name in old):
                assert UNMEASURED in line, f"{document}: {line}; run: python -m {tables.__name__}"
    rows = [line for line in DOCUMENTS[tables.ARCHIVE].splitlines() if line.startswith("|")]
    marked = [line for line in rows if any(f"[{name}](" in line for name in old)]
    assert [line for line in marked if tables.MARK not in line] == []


def test_pictures_of_trust_show_the_newest_reports(tmp_path):
    wanted = trust_plots.digest(trust_plots.shown())
    trust_plots.write(tmp_path)
    for name in trust_plots.FIGURES:
        for folder in (trust_plots.FOLDER, tmp_path):
            with Image.open(folder / name) as image:
                assert image.text[trust_plots.DIGEST] == wanted, f"run: python -m {trust_plots.__name__}"


def test_parameter_tables_are_those_of_the_nodes():
    fix = "run: python -m midastouch_tools.ros.parameter_tables > docs/parameters.md"
    assert (ROOT / "docs" / "parameters.md").read_text() == markdown(), fix
