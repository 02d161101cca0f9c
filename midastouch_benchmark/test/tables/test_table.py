"""One table, three ways to write it."""

import math

import pandas as pd
import pytest

from midastouch_benchmark.tables.table import (
    UNMEASURED,
    Table,
    flat,
    fraction,
    markdown,
    on_page,
    part,
    percent,
    pose,
    terminal,
    text,
    upright,
    value,
    with_row,
)
from midastouch_tools.drawing.page import Page

ROW = {"name": "mug", "trials": 120, "right": 60, "nested": {"share": 0.25, "interval": [0.2, 0.3]}, "wrong": None}


def test_what_is_nested_is_named_by_its_path():
    row = flat(ROW)
    assert (row["nested.share"], row["nested.interval"]) == (0.25, [0.2, 0.3])


@pytest.mark.parametrize(
    ("form", "row", "words"),
    [
        (text("a", "{:.1f} mm"), {"a": 1.24}, "1.2 mm"),
        (text("a"), {"a": math.nan}, "-"),
        (text("a"), {}, "-"),
        (percent("a", 1), {"a": 0.1234}, "12.3 %"),
        (part("a"), {"a": 3.0, "trials": 4}, "3 of 4"),
        (pose("e", "mean"), {"e_trans_mm.mean": 1.26, "e_rot_deg.mean": 3.0}, "1.3 mm, 3.0 deg"),
        (pose("e", "mean"), {"e_trans_mm.missing": 3}, "-"),
        (pose("e", "", "i"), {"e_trans_mm": 1, "e_rot_deg": 2, "i": [0.5, 2]}, "1.0 mm, 2.0 deg (0.5...2.0 mm)"),
        (fraction("a"), {"a.share": 0.25, "a.interval": [0.2, 0.3]}, "25 % (20%...30%)"),
        (fraction("a"), {"a.share": None, "a.interval": None}, "-"),
        (value("a", "{:.0f}", " s"), {"a.value": 2.0, "a.interval": None}, "2 s (-)"),
        (value("a", "{:.0f}", never=True), {"a.value": None, "a.interval": [3, None]}, "never (3...never)"),
        (value("a", "{:.0f}"), {"a.value": math.inf, "a.interval": [math.inf] * 2}, "never (never...never)"),
    ],
)
def test_a_form_turns_a_row_into_words(form, row, words):
    assert form(row) == words


@pytest.fixture
def table() -> pd.DataFrame:
    rows = [
        ROW | {"report": "a"},
        ROW | {"trials": 99, "report": "b"},
        {"name": "can", "measured": False, "report": "c"},
    ]
    claims = {"right": part("right"), "share": fraction("nested")}
    return Table({"object": text("name")}, claims).of(rows, "report")


def test_claims_need_enough_trials_and_a_report(table):
    assert table.to_numpy().tolist() == [
        ["mug", "60 of 120", "25 % (20%...30%)", "[a]"],
        ["mug", "too few (99)", "too few (99)", "[b]"],
        ["can", UNMEASURED, "-", "`c`"],
    ]


def test_a_document_has_it_unpadded(table):
    assert markdown(table).splitlines()[:3] == [
        "| object | right | share | report |",
        "| --- | --- | --- | --- |",
        "| mug | 60 of 120 | 25 % (20%...30%) | [a] |",
    ]


def test_a_terminal_has_it_in_columns(table):
    lines = terminal(table).splitlines()
    assert lines[0].split() == list(table.columns)
    assert lines[1].split() == ["-" * len(each) for each in lines[1].split()]
    assert len({line.find("60 of") + len("60 of 120") for line in lines if "60 of" in line}) == 1
    assert terminal(table.iloc[:0]).split() == list(table.columns)


def test_a_page_has_it_as_html_and_markdown(table, tmp_path):
    page = Page("results")
    on_page(page, table)
    assert "<td>too few (99)</td>" in page.write(tmp_path / "a.html").read_text()
    assert "60 of 120" in page.write_markdown(tmp_path / "a.md").read_text()


def test_a_wide_table_of_few_rows_stands_upright():
    wide = pd.DataFrame([[f"r{k}", *range(8)] for k in range(2)], columns=["what", *"abcdefgh"])
    turned = upright(wide)
    assert list(turned.columns) == ["what", "r0", "r1"]
    assert list(turned["what"]) == list("abcdefgh")
    assert upright(pd.concat([wide] * 2)).shape == (4, 9)


def test_a_last_row_has_dashes_where_it_has_no_cell(table):
    assert with_row(table, {"object": "paper"}).to_numpy()[-1].tolist() == ["paper", "-", "-", "-"]
    assert with_row(table, None) is table
