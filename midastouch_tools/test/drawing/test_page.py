from pathlib import Path

import pytest

from midastouch_tools.drawing.page import Page


@pytest.fixture
def page() -> Page:
    """A page with marks of HTML and of Markdown in every text."""
    page = Page("a_b < c")
    page.heading("x | y & z")
    page.note("1 * 2 <script>")
    page.code("midastouch demo --out <dir>")
    page.table(["name", "mm"], [["no_kld|<b", 1.0]])
    page.picture(Path("/somewhere/else/run.png"), 'say "[hi]"')
    return page


def test_text_is_escaped_and_pictures_are_relative(page, tmp_path):
    content = page.write(tmp_path / "sub" / "index.html").read_text()
    assert "<script>" not in content
    assert "a_b &lt; c" in content
    assert "<td>no_kld|&lt;b</td><td>1.0</td>" in content
    assert '<a href="run.png"><img src="run.png"' in content
    assert '<meta name="viewport"' in content
    assert "somewhere" not in content
    assert "&quot;[hi]&quot;" in content


def test_the_same_as_markdown(page, tmp_path):
    assert page.write_markdown(tmp_path / "index.md").read_text() == (
        "# a\\_b \\< c\n\n"
        "## x \\| y & z\n\n"
        "1 \\* 2 \\<script\\>\n\n"
        "```\nmidastouch demo --out <dir>\n```\n\n"
        "| name | mm |\n| --- | ---: |\n| no\\_kld\\|\\<b | 1.0 |\n\n"
        '![say "\\[hi\\]"](run.png)\n'
    )
