"""What `single-touch` says of several objects: means for the JSON, a table for the screen."""

from __future__ import annotations

import numpy as np

from midastouch_bringup.text_table import number, text_table

from .matches import TOP, mean_summary
from .per_object import BASELINES, CELL_COLUMNS, OURS

_FIGURES = (
    "normalised_top25_error",
    "median",
    "geodesic_normalised_top25_error",
    "nearest_entry",
    "normalised_by_single_random",
)


def summarise_objects(objects: list[dict]) -> dict:
    """`object`, `queries`, `summary` and `baselines` as for one object, means over all of them; and `objects`."""
    name = objects[0]["object"] if len(objects) == 1 else f"mean of {len(objects)} objects"
    baselines = {key: _mean(one["baselines"].get(key) for one in objects) for key in (OURS, *BASELINES)}
    return {
        "object": name,
        "queries": objects[0]["queries"],
        "missed": sum(one["missed"] for one in objects),
        "summary": mean_summary([one["summary"] for one in objects]),
        "baselines": baselines | {"missing": objects[0]["baselines"]["missing"]},
        "cell_columns": CELL_COLUMNS,
        "objects": objects,
    }


def _mean(values) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def single_touch_table(content: dict) -> str:
    """The paper's figure 14 as text: one line per object and one for all, best first."""
    header, rows = table_cells(content)
    return "\n".join([text_table(header, rows), *table_notes(content)])


def table_notes(content: dict) -> list[str]:
    """What has to be known to read the table."""
    notes = [
        f"pose error (6-vectors) of the nearest of the {TOP} best matches, over that of {TOP} random touches; "
        "geodesic: with the angle on SO(3);",
        "perfect: of the book's nearest entry; one random: over the error of a single random touch, the paper's other "
        "reading;",
        "small book: all ways on the same poses",
        *(f"{way}: {reason}" for way, reason in content["baselines"]["missing"].items()),
    ]
    if len(content["objects"]) > 1:
        average = content["summary"]["median_of_medians"]
        notes.append(
            f"median over objects of the medians: {average:.3f}; so the authors average (paper, ten test objects: "
            "0.473, image embedding 0.546)"
        )
    return notes


def table_cells(content: dict) -> tuple[list[str], list[list[object]]]:
    """Header and rows of the table, for screen and page."""
    header = [
        "object",
        "touches",
        "missed",
        f"top-{TOP} error",
        "median",
        "geodesic",
        "perfect",
        "one random",
        "random mm",
    ]
    header += ["small book: codes", "image embedding", "MinkLoc3D"]
    objects = sorted(content["objects"], key=lambda one: one["summary"]["normalised_top25_error"])
    rows = []
    for one in [*objects, *([content] if len(objects) > 1 else [])]:
        summary = one["summary"]
        row = [one["object"], one["queries"], one["missed"], *(number(summary[key], 3) for key in _FIGURES)]
        row.append(number(1e3 * summary["random_error"]))
        rows.append([*row, *(number(one["baselines"].get(way), 3) for way in (OURS, *BASELINES))])
    return header, rows
