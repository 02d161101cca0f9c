"""The paper's figures on real slides (section 6.2, figure 9; appendix E, figure 20), beside ours."""

from __future__ import annotations

from collections.abc import Iterable

from midastouch_bringup.datasets import Sequence
from midastouch_bringup.text_table import number
from midastouch_common.errors import InputError

BETA = 0.5
"""Width of the paper's starts on real slides."""
PAPER_REAL = {
    "trials": 500,
    "e_trans_mm": 19.7,
    "e_rot_deg": 21.5,
    "min_cluster_trans_mm": 11.1,
    "min_cluster_rot_deg": 10.8,
}
"""Fifty slides over ten objects, ten starts each: mean final error of the particles, median of the closest mode's."""

_HEADER = ["real slides", "trials", "particles mm (mean)", "deg", "closest mode mm (median)", "deg"]


def require_real(sequences: Iterable[Sequence]) -> None:
    """Raises InputError naming the first sequence that is not a real one of YCB-Slide."""
    for sequence in sequences:
        if sequence.layout != "real":
            raise InputError(
                f"{sequence.path}: not a real slide of YCB-Slide; get them with midastouch download ycb-slide real"
            )


def real_table(summary: dict) -> tuple[list[str], list[list[object]]]:
    """Header and rows of the comparison of an `evaluate` summary with `PAPER_REAL`."""
    errors = (("e_trans_mm", "mean"), ("e_rot_deg", "mean"))
    errors += (("min_cluster_trans_mm", "median"), ("min_cluster_rot_deg", "median"))
    paper = ["paper", PAPER_REAL["trials"], *(number(PAPER_REAL[key]) for key, _ in errors)]
    return _HEADER, [paper, ["ours", summary["trials"], *(number(summary[k].get(s)) for k, s in errors)]]
