from pathlib import Path

from midastouch_tools.drawing.page import Page


def test_text_is_escaped_and_pictures_are_relative(tmp_path):
    page = Page("a < b")
    page.heading("x & y")
    page.note("<script>")
    page.code("midastouch demo --out <dir>")
    page.table(["name", "mm"], [["a<b", 1.0]])
    page.picture(Path("/somewhere/else/run.png"), 'say "hi"')
    content = page.write(tmp_path / "sub" / "index.html").read_text()
    assert "<script>" not in content
    assert "a &lt; b" in content
    assert "<td>a&lt;b</td><td>1.0</td>" in content
    assert '<a href="run.png"><img src="run.png"' in content
    assert '<meta name="viewport"' in content
    assert "somewhere" not in content
    assert "&quot;hi&quot;" in content


def test_the_same_as_markdown(tmp_path):
    page = Page("a_b")
    page.heading("x | y")
    page.note("1 * 2 * 3")
    page.code("midastouch demo --out <dir>")
    page.table(["name", "mm"], [["no_kld|", 1.0]])
    page.picture(Path("/somewhere/else/run.png"), "a [run]")
    assert page.write_markdown(tmp_path / "index.md").read_text() == (
        "# a\\_b\n\n"
        "## x \\| y\n\n"
        "1 \\* 2 \\* 3\n\n"
        "```\nmidastouch demo --out <dir>\n```\n\n"
        "| name | mm |\n| --- | ---: |\n| no\\_kld\\| | 1.0 |\n\n"
        "![a \\[run\\]](run.png)\n"
    )
