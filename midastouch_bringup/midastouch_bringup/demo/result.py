"""What a run of the demo came to: final errors, rates, particles and state."""

from __future__ import annotations

import numpy as np

from midastouch_common.pose_metric import closest_mode_error, particle_rmse, pose_errors

from ..bags.run_record import RunRecord
from ..text_table import number
from . import NODES

_FOUND_MM, _FOUND_DEG = 10, 15


def demo_result(record: RunRecord, object_name: str, seconds: float) -> dict:
    """The content of `result.json`; seconds: from the first answer to the last."""
    last = record.snapshots[-1]
    modes = np.array([mode.pose for mode in last.modes]).reshape(-1, 4, 4)
    errors = {
        "particles": particle_rmse(last.particles, last.truth),
        "closest mode": closest_mode_error(modes, last.truth),
        "published pose": (np.nan, np.nan) if last.estimate is None else pose_errors(last.estimate, last.truth),
    }
    stage_ms = {**record.node_ms, "particle_filter": float(np.mean(record.filter_ms))}
    return {
        "object": object_name,
        "frames": len(record.snapshots),
        "final": {
            name: {"trans_mm": 1e3 * float(e[0]), "rot_deg": float(np.degrees(e[1]))} for name, e in errors.items()
        },
        "state": last.state,
        "n_particles": record.n_particles[-1],
        "n_modes": len(last.modes),
        "stage_ms": {name: stage_ms[name] for name in NODES if name in stage_ms},
        "hz": (len(record.snapshots) - 1) / seconds if seconds > 0 else None,
    }


def is_found(error: dict) -> bool:
    """Whether an error of a result, `trans_mm` and `rot_deg`, is that of the right place."""
    return error["trans_mm"] <= _FOUND_MM and error["rot_deg"] <= _FOUND_DEG


def result_rows(result: dict) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of a result."""
    rows = [
        [f"{name}, final error", f"{number(e['trans_mm'])} mm, {number(e['rot_deg'])} deg"]
        for name, e in result["final"].items()
    ]
    rows += [
        [f"{name}", f"{number(1e3 / ms, 0)} Hz ({number(ms, 2)} ms per frame)"]
        for name, ms in result["stage_ms"].items()
        if ms > 0
    ]
    found = "yes" if is_found(result["final"]["closest mode"]) else "no"
    rows.append([f"found (closest mode within {_FOUND_MM} mm, {_FOUND_DEG} deg)", found])
    rows.append(["frames over DDS", f"{result['frames']} at {number(result['hz'])} Hz"])
    rows.append(["state", f"{result['state']}, {result['n_particles']} particles, {result['n_modes']} modes"])
    return [result["object"], ""], rows
