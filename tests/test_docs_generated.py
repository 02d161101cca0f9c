"""What programs write into the documents is what they would write now: figures, pictures, parameters."""

import pytest
from documents import DOCUMENTS, ROOT
from PIL import Image

from midastouch_bringup.ros.parameter_tables import markdown


@pytest.mark.parametrize("document", ["README.md", "docs/evaluation.md", "docs/trust.md"])
def test_figures_are_those_of_the_reports(document, load_tool):
    tool = load_tool("evaluation_tables")
    assert document in tool.DOCUMENTS
    assert DOCUMENTS[document].count("<!-- table ") == DOCUMENTS[document].count("<!-- end -->") > 0
    assert DOCUMENTS[document] == tool.filled(document), "run: .venv/bin/python tools/evaluation_tables.py"


def test_pictures_of_trust_show_the_newest_reports(load_tool, tmp_path):
    tool = load_tool("trust_plots")
    wanted = tool.digest(tool.shown())
    tool.write(tmp_path)
    for name in tool.FIGURES:
        for folder in (tool.FOLDER, tmp_path):
            with Image.open(folder / name) as image:
                assert image.text[tool.DIGEST] == wanted, "run: .venv/bin/python tools/trust_plots.py"


def test_parameter_tables_are_those_of_the_nodes():
    mend = "run: python -m midastouch_bringup.ros.parameter_tables > docs/parameters.md"
    assert (ROOT / "docs" / "parameters.md").read_text() == markdown(), mend
