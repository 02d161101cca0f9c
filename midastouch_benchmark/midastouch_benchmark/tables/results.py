"""Tables of a result, each with its title, in the order in which a terminal and a page show them."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from ..statistics.comparison import front_text, rows_by_init
from ..trials.variants import DEFAULT
from . import accuracy, comparisons, exploring, trust
from .table import terminal, text, tidy, written

Titled = tuple[str, pd.DataFrame]


def shown(parts: Iterable[Titled]) -> str:
    """Return tables with their titles as text for a terminal."""
    return "\n\n".join(f"{title}\n{terminal(table)}".strip() for title, table in parts)


def of_start(content: dict, init: str) -> list[Titled]:
    """Return the tables on the filter as shipped with one start, of a result of `midastouch benchmark`."""
    summary = content["summary"][DEFAULT][init]
    symmetries = {one["object"]: one["symmetry"] for one in content["objects"]}
    beside = {"object": "the paper's ten"} | accuracy.PAPER if init == "paper" else None
    trials = [t for t in content["trials"] if t["variant"] == DEFAULT and t["init"] == init]
    frame = tidy([{"what": init} | accuracy.summary_row(summary, trials)])
    objects = accuracy.objects(summary, symmetries, beside)
    if not summary["trust"]["enough"]:
        return [(f"start: {init}; too few trials ({summary['trials']}) to claim anything", objects)]
    out = [
        (f"start: {init}", objects),
        ("with 95 % intervals", written(frame, {"start": text("what")}, accuracy.LOCALISATION)),
        ("what `converged` promises", trust.converged_table(frame)),
        ("does the covariance hold the truth?", trust.regions_table(frame)),
        ("is the published pose right, by the weight of its mode?", trust.weights_table({"right": summary["trust"]})),
    ]
    if summary["recovery"]:
        out.append(("around the event", trust.events_table(frame)))
    if summary["held"]:
        words = {name: content["variants"][name]["summary"] for name in content["summary"]}
        of = {words[name]: by_init[init]["held"] for name, by_init in content["summary"].items()}
        out.append(("held still", comparisons.grasps_table(of)))
    methods = comparisons.methods_table(content, init)
    return [*out, ("methods on the same slides", methods)] if len(methods) > 1 else out


def of_variants(content: dict) -> list[Titled]:
    """Return a table for each start of variants against the default on the same trials; none without variants."""
    return [
        (f"variants, start: {init}; {front_text(rows)}", comparisons.compared_table(content | {"comparison": rows}))
        for init, rows in rows_by_init(content["comparison"]).items()
        if len(rows) > 1
    ]


def of_identification(content: dict) -> list[Titled]:
    """Return the table of a result of `midastouch identify`; none before the first trial."""
    if not (summary := content.get("identification")):
        return []
    rows = tidy([exploring.identification_row(f"of {summary['objects']}", summary)])
    return [("which object", exploring.identification_table(rows))]
