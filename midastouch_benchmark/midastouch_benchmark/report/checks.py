"""The section of the results page on the checks of tactile images."""

from __future__ import annotations

from pathlib import Path

from midastouch_bringup.drawing.page import Page

from ..perception.check_tables import check_tables


def check_section(page: Page, contents: list[dict], folder: Path) -> None:
    """The tables of each `evaluate-checks` result."""
    page.heading("Checks on tactile images")
    for content in contents:
        page.note(
            f"network {content['network']}, sensor {content['sensor']}: {content['sensors']} imaginary sensors over "
            f"{content['no_contact_images']} real no-contact images; shares, and areas under the ROC curve against the "
            "sensors that are right"
        )
        for header, rows in check_tables(content):
            page.table(header, rows)
