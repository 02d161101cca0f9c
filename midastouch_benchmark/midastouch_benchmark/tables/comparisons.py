"""Tables of the filter against other methods and against itself: fewer poses, parts off, other contacts."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from ..statistics.accuracy import counted_anew, pose_right_at_end
from ..statistics.comparison import pareto_front, verdict
from ..statistics.intervals import ENOUGH
from ..trials.grasps import HOLDS, PINCHED
from ..trials.variants import DEFAULT, PRESET
from .reports import ABLATIONS, report, reported, rows_of
from .table import Form, Row, Table, between, fraction, is_missing, percent, pose, text, value


def _difference(row: Row) -> str:
    if is_missing(row["difference_mm"]):
        return "-"
    return f"{row['difference_mm']:+.1f} mm ({between(row['difference_mm_interval'], '{:+.1f}')})"


COMPARED: dict[str, Form] = {
    "particles, mean": lambda row: f"{row['e_trans_mm']:.1f} mm, {row['e_rot_deg']:.1f} deg",
    "paired difference": _difference,
    "right": lambda row: f"{row['right'] * row['trials']:.0f} of {row['trials']:.0f}",
    "frames converged wrong": percent("wrong_converged", 1),
    "CPU a frame; against the default": lambda row: f"{row['cpu_ms_filter']:.1f} ms; {verdict(row)}",
}
"""Columns on a variant against the default on the same trials, of a row of `compare_variants`."""
_AT_END = pose("estimate", "median", "trust.estimate_trans_mm.median.interval")
METHODS = Table(
    {"method": text("what"), "trials": text("trials")},
    {
        "published pose, median": _AT_END,
        "pose right, in any state": fraction("pose_right"),
        "right": fraction("trust.right_at_end"),
        "frames converged wrong": fraction("trust.converged_wrong", 1),
        "CPU a frame": value("trust.filter_cpu_ms.mean", "{:.1f}", " ms"),
    },
)
_BELIEF: dict[str, Form] = {
    "closest mode found": fraction("found"),
    "probability at the true pose": fraction("share"),
    "pose right": fraction("right"),
    "converged": fraction("converged"),
    "converged wrong": fraction("converged_wrong"),
}
_CONTACTS: dict[str, Form] = {"contacts": text("what"), "held": text("seconds", "{} s")}


def compared(content: dict) -> list[dict]:
    """Return the rows of a result's comparison, with each variant's summary and group."""
    words = {name: {key: each[key] for key in ("summary", "group")} for name, each in content["variants"].items()}
    return [one | words[one["variant"]] for one in content["comparison"]]


def compared_table(content: dict) -> pd.DataFrame:
    """Table of variants of a result of `midastouch benchmark` against its default, by start."""
    about = {"start": text("init"), "variant": text("variant"), "trials": text("trials"), "filter": text("summary")}
    return Table(about | COMPARED).of(compared(content))


def methods_table(content: dict, init: str) -> pd.DataFrame:
    """Table of the default and other methods behind the same networks, of one start of a `midastouch benchmark`."""
    rows = [
        {"what": content["variants"][name]["summary"], "pose_right": pose_right_at_end(some)}
        | {key: each for key, each in counted_anew(by_init[init], some).items() if key != "objects"}
        for name, by_init in content["summary"].items()
        if "trust" in by_init.get(init, {})
        and (some := [t for t in content["trials"] if (t["variant"], t["init"]) == (name, init)])
    ]
    return METHODS.of(rows)


def grasps_table(grasps: Mapping[str, list[dict]]) -> pd.DataFrame:
    """Table of the belief in grasps; grasps: by label, a summary for each time of `HOLDS`, or of `PINCHED`."""
    return Table(_CONTACTS, _BELIEF).of(_held(grasps))


def _held(grasps: Mapping[int, list[dict]] | Mapping[str, list[dict]]) -> list[dict]:
    return [
        {"what": what, "seconds": after} | one
        for what, each in grasps.items()
        for after, one in zip(HOLDS if len(each) == len(HOLDS) else PINCHED, each, strict=True)
    ]


def baselines() -> pd.DataFrame:
    """Table of other methods behind the same networks, on the same trials."""
    if "peers" not in reported():
        return METHODS.of(rows_of({"peers": "-"}))
    content = report("peers")
    (init,) = content["summary"][DEFAULT]
    table = methods_table(content, init)
    for name, why in content["skipped_variants"].items():
        dashes = ["-"] * (len(METHODS.claims) - 1)
        table.loc[len(table)] = [name, "-", f"skipped: {why.partition(':')[0]}", *dashes]
    return table


def grasps() -> pd.DataFrame:
    """Table of grasps without sliding, by the number of fingers that touch."""

    def rows(name: str) -> list[dict]:
        by_variant = {name: one["held"] for name, each in report(name)["summary"].items() for one in each.values()}
        return _held({k: by_variant[v] for k, v in enumerate(("contact_1", "contacts_2", DEFAULT), 1)})

    objects = {"grasp": "the ten", "grasp_cad": "CAD parts"}
    names = [name for name in objects if name in reported()] or ["grasp"]
    found = rows_of(dict.fromkeys(names, "-"), rows)
    return Table({"objects": lambda row: objects[row["report"]]} | _CONTACTS, _BELIEF).of(found, "report")


def pinches() -> pd.DataFrame:
    """Table of pinches by two fingers, by their number."""

    def rows(name: str) -> list[dict]:
        (summary,) = report(name)["summary"][DEFAULT].values()
        at_end = {key: summary[key] for key in ("trust", "estimate_trans_mm", "estimate_rot_deg")}
        return [{"what": k} | at_end | one for k, one in enumerate(summary["held"], 1)]

    objects = {"pinch": "the ten", "pinch_cad": "CAD parts"}
    found = rows_of(dict.fromkeys(objects, "-"), rows)
    about = {"objects": lambda row: objects[row["report"]], "pinches": text("what")}
    last = {"published pose, median": lambda row: _AT_END(row) if row["what"] == len(PINCHED) else "-"}
    return Table(about, _BELIEF | last).of(found, "report")


def variants() -> pd.DataFrame:
    """Table of the effect of each part of the filter, under the protocols that exercise it."""
    rows = rows_of(ABLATIONS, lambda name: compared(report(name)))
    return Table({"conditions": text("what"), "filter": text("summary")}, COMPARED).of(rows, "report")


def front() -> pd.DataFrame:
    """Table of run time and error of the default, the presets, and settings with more or less work, poses or modes;
    fastest first."""
    if "front" not in reported():
        return Table({"filter": text("what")}, COMPARED).of(rows_of({"front": "-"}), "report")
    return front_table(report("front"))


def front_table(content: dict) -> pd.DataFrame:
    """Table `front` of a result of `midastouch benchmark --variant front`."""
    best = [one["variant"] for one in pareto_front(content["comparison"], "e_trans_mm")]
    rows = sorted(compared(content), key=lambda row: row["cpu_ms_filter"])
    if (trials := rows[0]["trials"]) < ENOUGH:  # one row stands for all
        rows = [{"summary": f"{len(rows)} variants", "trials": trials, "group": ""}]

    def what(row: Row) -> str:
        return f"**{row['summary']}**" if row["group"] in (DEFAULT, PRESET) else row["summary"]

    claims = {"nothing is both faster and more exact": lambda row: "yes" if row["variant"] in best else ""} | COMPARED
    return Table({"filter": what}, claims).of((row | {"report": "front"} for row in rows), "report")
