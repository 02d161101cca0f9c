"""Rows of reports that are of other code than today's say so."""

import pandas as pd
import pytest

from midastouch_benchmark.tables import documents, reports
from midastouch_benchmark.tables.documents import MARK, marked

KNOWN = {"perception": "aaaaaaaa", "estimates": "bbbbbbbb"}


@pytest.fixture
def of_code(monkeypatch) -> dict[str, str | None]:
    """Fingerprints by the name of a report, to be filled in; all reports are there."""
    found: dict[str, str | None] = {}
    for module in (documents, reports):
        monkeypatch.setattr(module, "ids_of_today", lambda: KNOWN)
        monkeypatch.setattr(module, "fingerprint_of", lambda name: found[name])
        monkeypatch.setattr(module, "reported", lambda: list(found))
    return found


def table(*names: str) -> pd.DataFrame:
    rows = [[f"row of {name}", "1 mm", f"[{name}]"] for name in names]
    return pd.DataFrame(rows, columns=["what", "error", "report"])


def test_reports_are_stale_that_are_of_other_code_or_do_not_say(of_code):
    of_code |= {
        "a": "bbbbbbbb",
        "b": "aaaaaaaa+bbbbbbbb",
        "c": "cccccccc",
        "d": None,
        "e": "aaaaaaaa+cccccccc",
        "soak": None,
    }
    assert reports.stale(of_code) == ["c", "d", "e"]


def test_rows_of_today_are_not_marked(of_code):
    of_code |= {"a": "bbbbbbbb", "b": "aaaaaaaa"}
    text, names = marked(lambda: table("a", "b"))
    assert MARK not in text
    assert names == ["a", "b"]


def test_a_stale_row_is_marked_and_a_mixture_is_said(of_code):
    of_code |= {"a": "bbbbbbbb", "b": "cccccccc"}
    lines = marked(lambda: table("a", "b"))[0].splitlines()
    assert lines[2:4] == ["| row of a | 1 mm | [a] |", f"| row of b | 1 mm | [b] {MARK} |"]
    assert lines[5].startswith(f"{MARK} measured with earlier code, fingerprint cccccccc; today's: `aaaaaaaa`, `bbbb")
    assert "Rows of several fingerprints" in lines[5]


def test_a_table_all_of_one_earlier_filter_is_no_mixture(of_code):
    of_code |= {"a": "cccccccc", "b": "cccccccc"}
    assert "several" not in marked(lambda: table("a", "b"))[0]


def test_rows_are_marked_that_name_no_report(of_code, monkeypatch, tmp_path):
    of_code |= {"a": None}
    (tmp_path / "a.json").write_text("{}")
    monkeypatch.setattr(reports, "report_path", lambda name: tmp_path / "a.json")

    def make() -> pd.DataFrame:
        reports.report("a")
        return table("a").iloc[:, :2]

    text, names = marked(make)
    assert f"| row of a {MARK} | 1 mm |" in text
    assert "fingerprint unknown" in text
    assert names == ["a"]
