"""The section of the results page on which object it is."""

from __future__ import annotations

from pathlib import Path

from midastouch_bringup.drawing.page import Page

from ..statistics.identification_summary import identification_table


def identification_section(page: Page, contents: list[dict], folder: Path) -> None:
    """Add a table and what was taken for what of each `identify` result."""
    page.heading("Which object")
    for content in contents:
        page.note(f"catalogue: {', '.join(content['catalogue'])}")
        page.table(*identification_table(content["identification"]))
        wrong = content["identification"]["answers"]
        page.note("; ".join(f"{answer}: {times}" for answer, times in wrong.items()) or "every answer is right")
