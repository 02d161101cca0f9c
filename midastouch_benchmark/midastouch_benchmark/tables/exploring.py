"""Tables of which object it is, and where to touch next."""

from __future__ import annotations

from midastouch_benchmark.statistics.exploration_summary import summarise_exploration

from .cells import between, millimetres, millimetres_between, share_cell
from .reports import UNMEASURED, Table, report, reported


def identification() -> Table:
    """Which object of a catalogue it is."""
    header = ["catalogue", "slides", "right at the end", "pose right, too", "pose, object known"]
    header += ["refused, when left out", "path until right, median", "expected calibration error"]
    header += ["CPU a frame, over one known object's", "report"]
    rows = []
    for name, what in (("identify", "the ten"), ("identify_all", "all 78 of YCB")):
        if name not in reported():
            rows.append([what, *["*not measured yet*"] * 8, "-"])
            continue
        one = report(name)["identification"]
        cells = [f"too few ({one['known']})"] * 7
        if one["enough"]:
            path, ratio = one["path_until_right"], one["cpu_ratio"]
            until = "never" if path["value"] is None else f"{path['value']:.2f} m"
            cells = [
                *(share_cell(one[key]) for key in ("right", "pose_right", "alone_pose_right", "refused")),
                f"{until} ({between(path['interval'], '{:.2f}')})",
                f"{one['calibration_error']:.3f}",
                f"{ratio['value']:.2f} ({between(ratio['interval'], '{:.2f}')})",
            ]
        rows.append([what, f"{one['known']} with, {one['unknown']} without", *cells, f"[{name}]"])
    return header, rows


def shapes() -> Table:
    """Catalogues of ever more random shapes."""
    header = ["shapes", "slides", "compared after 0.1 m", "leads then", "compared at the end", "leads then", "right"]
    header += ["refused, when left out", "CPU a frame", "slowest frame", "memory", "report"]
    if "identify_shapes" not in reported():
        return header, [[UNMEASURED, *["-"] * 11]]
    rows = []
    for size, one in report("identify_shapes")["shape_catalogues"].items():
        cells = [f"too few ({one['known']})"] * 6
        if one["enough"]:
            shares = ("compared_early", "leads_early", "compared", "leads", "right", "refused")
            cells = [share_cell(one[key]) for key in shares]
        cells += [f"{one['cpu_ms']['value']:.1f} ms ({between(one['cpu_ms']['interval'], '{:.1f}')})"]
        cells += [f"{one['slowest_ms']:.0f} ms", f"{one['memory_mib']:.0f} MiB"]
        rows.append([size, f"{one['known']} with, {one['unknown']} without", *cells, "[identify_shapes]"])
    return header, rows


def exploration() -> Table:
    """A finger that is told where to touch next, against one that goes anywhere."""
    header = ["finger goes", "trials", "converged right", "converged wrong", "said alike", "path until right, median"]
    header += ["over that of random", "answers within, CPU", "report"]
    if "exploration" not in reported():
        return header, [[UNMEASURED, *["-"] * 8]]
    content, rows = report("exploration"), []
    for name, one in summarise_exploration(content["trials"]).items():
        cells = [f"too few ({one['trials']})"] * 6
        if one["enough"]:
            path, ratio, asked = one["path_m"], one["path_ratio"], one["asked_ms"]
            cells = [share_cell(one[key]) for key in ("right", "wrong", "alike")]
            cells += [f"{millimetres(path['value'])} mm ({millimetres_between(path['interval'])})"]
            cells += ["-" if ratio is None else f"{ratio:.2f}", "-" if asked is None else f"{asked:.0f} ms"]
        rows.append([content["config"]["policies"][name], one["trials"], *cells, "[exploration]"])
    return header, rows


def twins() -> Table:
    """Places that feel alike but for what lies elsewhere: are they told apart, or is it said that they cannot be?"""
    header = ["objects", "trials", "another place competed", "of these told apart", "of these said alike"]
    header += ["converged wrong", "path until right, median", "report"]
    if "twins" not in reported():
        return header, [[UNMEASURED, *["-"] * 7]]
    (one,) = summarise_exploration(report("twins")["trials"]).values()
    cells = [f"too few ({one['trials']})"] * 5
    if one["enough"]:
        cells = [share_cell(one[key]) for key in ("rivalled", "told_apart", "said_alike", "wrong")]
        cells.append(f"{millimetres(one['path_m']['value'])} mm ({millimetres_between(one['path_m']['interval'])})")
    return header, [[", ".join(one["objects"]), one["trials"], *cells, "[twins]"]]
