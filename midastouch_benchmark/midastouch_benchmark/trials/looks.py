"""Comparisons that stop when they are decided: slides are added only for the variants that are still undecided.

They are group-sequential with equal looks; the error probability is divided evenly (Bonferroni), which is conservative.
"""

from __future__ import annotations

import dataclasses

from midastouch_common.mesh import ObjectMesh

from ..statistics.comparison import compare_variants, decided
from .campaign import Plan, run_campaign
from .trial_log import TrialLog, Workforce
from .variants import DEFAULT


def run_in_looks(
    plan: Plan, meshes: list[ObjectMesh], log: TrialLog, workforce: Workforce, looks: int
) -> tuple[list[dict], int]:
    """Run as `run_campaign`, then again with as many new slides for the undecided variants, at most `looks` times."""
    count, open_, trials = len(plan.slides), plan.variants, []
    for look in range(looks):
        slides = tuple(range(look * count, (look + 1) * count))
        found, missing = run_campaign(dataclasses.replace(plan, slides=slides, variants=open_), meshes, log, workforce)
        trials += found
        rows = compare_variants(trials, looks)
        left = {row["variant"] for row in rows if row["variant"] in open_ and not decided(row)} - {DEFAULT}
        if missing or not left:
            break
        open_ = tuple(name for name in plan.variants if name in left | {DEFAULT})
    return trials, missing
