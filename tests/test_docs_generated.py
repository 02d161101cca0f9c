"""What programs write into the documents is what they would write now: figures, pictures, parameters."""

import re

import pytest
from documents import DOCUMENTS, ROOT, section, table
from PIL import Image

from midastouch_benchmark.tables import documents as tables
from midastouch_benchmark.tables import trust_plots
from midastouch_benchmark.tables.reports import stale
from midastouch_bringup.ros.parameter_tables import markdown


@pytest.mark.parametrize("document", tables.DOCUMENTS)
def test_figures_are_those_of_the_reports(document):
    assert DOCUMENTS[document].count("<!-- table ") == DOCUMENTS[document].count("<!-- end -->") > 0
    assert DOCUMENTS[document] == tables.filled(document), f"run: python -m {tables.__name__}"


def test_the_figures_of_the_evaluation_stand_in_its_tables():
    tables_of_reports = DOCUMENTS["reports/README.md"] + DOCUMENTS["docs/trust.md"]
    figures = table("docs/evaluation.md", "## The figures")
    assert len(figures) >= 12
    assert [what for _, what, figure, _ in figures if f"| {figure} |" not in tables_of_reports] == []
    numbered = re.findall(r"^(\d+)\. \*\*", section("docs/evaluation.md", "## The figures"), flags=re.M)
    assert numbered == [number for number, *_ in figures]


def test_figures_of_an_earlier_filter_are_marked():
    """Rows of a headline page whose report is of other code than today's; a release allows none."""
    for name in stale(tables.headline()):
        for document in ("README.md", "docs/evaluation.md", "docs/trust.md"):
            for line in DOCUMENTS[document].splitlines():
                if line.startswith("|") and f"[{name}](" in line:
                    assert tables.MARK in line, f"{document}: {line}; run: python -m {tables.__name__}"


def test_pictures_of_trust_show_the_newest_reports(tmp_path):
    wanted = trust_plots.digest(trust_plots.shown())
    trust_plots.write(tmp_path)
    for name in trust_plots.FIGURES:
        for folder in (trust_plots.FOLDER, tmp_path):
            with Image.open(folder / name) as image:
                assert image.text[trust_plots.DIGEST] == wanted, f"run: python -m {trust_plots.__name__}"


def test_parameter_tables_are_those_of_the_nodes():
    fix = "run: python -m midastouch_bringup.ros.parameter_tables > docs/parameters.md"
    assert (ROOT / "docs" / "parameters.md").read_text() == markdown(), fix
