"""Tables of speed, load and faults."""

from __future__ import annotations

import pandas as pd

from .reports import report, rows_of
from .table import Form, Row, Table, flat, is_missing, listed, percent, several, text, value

_SENSOR_HZ = 60
SCALING = Table(
    {
        "hypotheses at the start": text("particles", "{:,}"),
        "codebook poses": text("poses", "{:,}"),
        "CPU ms a step": text("step_ms.cpu", "{:.2f}"),
        "wall ms, p50": text("step_ms.p50", "{:.2f}"),
        "p95": text("step_ms.p95", "{:.2f}"),
        "memory MiB": text("memory_mb", "{:.0f}"),
    }
)
_STAGES = {
    "tdn_ms": "depth network",
    "calibrated_tdn_ms": "depth network of a calibrated sensor, with integration and depth",
    "tcn_ms": "code network",
    "fit_check_ms": "fit check, every fifth frame",
    "fcrn_ms": "the paper's depth network, FCRN",
    "minkloc3d_ms": "the paper's code network, MinkLoc3D",
    "end_to_end_ms": "image to estimate, searching",
    "frame_ms": "image to the end of the frame, searching",
    "converged_ms": "image to estimate, converged",
    "converged_frame_ms": "image to the end of the frame, converged",
    "pose_age_ms": "age of an image when its transform is found, 500 Hz of 20 links",
    "filter_ms": "filter step, until its answer:",
    "deferred_ms": "filter, after its answer:",
    "align_ms": "alignment of one hypothesis to one map",
    "lookup_ms": "look-up of all untested poses",
    "sim_image_ms": "simulated image, light:",
}
"""Stages that `midastouch bench` times, with their label, by key of its result; a colon: several of that kind."""


def _fractions_of_60_hz(row: Row) -> str:
    """Return the percentages of the sensor's rate that the machine reaches while searching and converged."""
    rates = (row.get("end_to_end_hz"), row.get("converged_hz"))
    return "; ".join("-" if is_missing(hz) else f"{min(100, 100 * hz / _SENSOR_HZ):.0f} %" for hz in rates)


def _over_fcrn(row: Row) -> str:
    """Return times of this pipeline over that of the paper's depth network in the same run."""
    times = (row.get(f"{key}.p50") for key in ("end_to_end_ms", "converged_ms", "converged_frame_ms"))
    return "; ".join("-" if is_missing(ms) else f"{ms / row['fcrn_ms.p50']:.3f}" for ms in times)


def _images_a_second(row: Row) -> str:
    cpu = (row[f"sim_image_ms.{light}.cpu"] for light in ("additive", "relative"))
    return "; ".join(f"{1e3 / ms:.0f}" for ms in cpu) + " a second"


_SPEED: dict[str, Form] = {
    "depth network, p50": text("tdn_ms.p50", "{:.1f} ms"),
    "code network, p50": text("tcn_ms.p50", "{:.1f} ms"),
    "filter step until its answer, p50: searching; converged": several(
        "{:.1f}", " ms", "filter_ms.searching.p50", "filter_ms.converged.p50"
    ),
    "... work after the answer, p50": several(
        "{:.1f}", " ms", "deferred_ms.searching.p50", "deferred_ms.converged.p50"
    ),
    "alignment of one hypothesis to one map, p50": text("align_ms.p50", "{:.2f} ms"),
    "look-up of all untested poses, p50": text("lookup_ms.p50", "{:.1f} ms"),
    "... that finds the exact nearest entry": percent("lookup_exact_share", 1),
    "images to the end of the frame: searching; converged": several("{:.0f}", " Hz", "end_to_end_hz", "converged_hz"),
    "image to estimate over FCRN's time, p50: searching; converged; converged, the whole frame": _over_fcrn,
    "share of the sensor's 60 Hz: searching; converged": _fractions_of_60_hz,
    "renders of 240 x 320": text("renders_per_s", "{:.0f} a second"),
    "simulated images of `digit_sim` on one core: additive; relative light": _images_a_second,
    "codebook poses": text("codebook_poses_per_s", "{:.0f} a second"),
    "the paper's networks, p50: FCRN; MinkLoc3D": several("{:.0f}", " ms", "fcrn_ms.p50", "minkloc3d_ms.p50"),
    "the filter's process: active after, p50; longest": several(
        "{:.1f}", " s", "filter_start_s.p50", "filter_start_s.max"
    ),
    "... its memory then": text("filter_rss_mb", "{:.0f} MiB"),
    "age of an image when its transform is found, with 500 Hz of transforms, p50; p95": several(
        "{:.0f}", " ms", "pose_age_ms.p50", "pose_age_ms.p95"
    ),
    "... with so many images": text("pose_age_hz", "{:.0f} Hz"),
}
_RATES: dict[str, Form] = {
    "rate while searching": text("end_to_end_hz", "{:.1f} Hz"),
    "rate once converged": text("converged_hz", "{:.1f} Hz"),
    "share of 60 Hz while searching; once converged": _fractions_of_60_hz,
    "images while their age was measured": text("pose_age_hz", "{:.0f} Hz"),
    "exact look-ups": percent("lookup_exact_share", 2),
    "renders": text("renders_per_s", "{:.0f} a second"),
    "codebook poses": text("codebook_poses_per_s", "{:.0f} a second"),
    "memory at most": text("peak_rss_mb", "{:.0f} MiB"),
    "the filter's process active after": text("filter_start_s.p50", "{:.1f} s"),
    "... with": text("filter_rss_mb", "{:.0f} MiB"),
}


def stages(content: dict) -> pd.DataFrame:
    """Table of the milliseconds of each stage of a `bench` result: wall time and CPU time."""
    rows = []
    for key, what in _STAGES.items():
        one = content.get(key, {})
        parts = {what: one} if "p50" in one else {f"{what} {name}": each for name, each in one.items()}
        rows += [{"what": label} | times for label, times in parts.items()]
    times = {label: text(label.lower(), "{:.2f}") for label in ("p50", "p95", "CPU")}
    return Table({"ms": text("what")} | times).of(rows)


def speed() -> pd.DataFrame:
    """Table of each stage on two shared cores."""
    return listed(("what", "[bench]"), _cells(report("bench"), _SPEED))


def rates(content: dict) -> pd.DataFrame:
    """Table of the rates and the memory of a `bench` result."""
    return listed(("what", "measured"), (cell for cell in _cells(content, _RATES) if cell[1] != "-"))


def _cells(content: dict, forms: dict[str, Form]) -> list[tuple[str, object]]:
    row = flat(content)
    return [(what, form(row)) for what, form in forms.items()]


def scaling() -> pd.DataFrame:
    """Table of the newest report on time and memory of a step, over hypotheses at the start and codebook poses."""
    return SCALING.of(rows_of({"scale": "-"}, lambda name: report(name)["scaling"]), "report")


def start() -> pd.DataFrame:
    """Table of the time until the first pose on an object that comes without a codebook."""

    def row(name: str) -> dict:
        one = report(name)["start"]
        return one | {"over_fcrn": 1e3 * one["first_pose_s"]["value"] / report("bench")["fcrn_ms"]["p50"]}

    def touches(row: Row) -> str:
        return f"{row['trials']}, of {row['objects']} objects" if row["measured"] else "-"

    claims = {
        "pose after, median": value("first_pose_s", "{:.1f}", " s"),
        "longest": text("first_pose_s.max", "{:.1f} s"),
        "median over an image of the paper's FCRN": text("over_fcrn", "{:.0f}"),
        "CPU time of the codebook and the filter on it, mean": text("build_cpu_s", "{:.1f} s"),
    }
    return Table({"first touches": touches}, claims).of(rows_of({"start": "-"}, row), "report")


def load() -> pd.DataFrame:
    """Table of latency at the sensor's rate, also relative to the paper's depth network on the same machine."""
    fcrn = report("bench")["fcrn_ms"]["p50"]

    def times(row: Row) -> tuple[float, float]:
        return row["load.image_to_pose_ms.p50"], row["load.image_to_pose_ms.p99"]

    about = {
        "object": text("object"),
        "minutes": text("minutes", "{:.0f}"),
        "images answered": lambda row: f"{row['load.answered']} of {row['load.sent']}",
        "image to pose, p50; p99": lambda row: "{:.0f}; {:.0f} ms".format(*times(row)),
        "over FCRN's time": lambda row: "{:.3f}; {:.2f}".format(*(each / fcrn for each in times(row))),
    }
    return Table(about).of(rows_of(dict.fromkeys(("load_eyebolt", "load_mug"), "-")), "report")


def soak() -> pd.DataFrame:
    """Table of load and faults."""
    one = report("soak")
    load, killed, late, plug = one["load"], one["killed"], one["transforms_200_ms_late"], one["unplugged"]
    steps, refused = one["filter"], one["malformed"]["refused"]
    milliseconds, rss = load["image_to_pose_ms"], load["resident_mb"]
    rows = [
        [f"{load['fps']:.0f} images a second for {load['seconds'] / 60:.0f} minutes: answered by a pose",
         _of(load, "answered")],
        ["... image to pose, p50; p99", f"{milliseconds['p50']:.0f}; {milliseconds['p99']:.0f} ms"],
        ["... growth of `tdn`; `tcn`; `particle_filter`",
         "; ".join(f"{rss[n]['growth']:.1f}" for n in ("tdn", "tcn", "particle_filter")) + " MiB"],
        *([f"`{name}` killed: first pose after", f"{each['back_after_s']:.1f} s"] for name, each in killed.items()),
        [f"sensor unplugged for {plug['for_s']:.0f} s: ERROR; `stale`; pose again after",
         f"{plug['error_after_s']:.1f}; {plug['stale_after_s']:.1f}; {plug['back_after_s']:.1f} s"],
        ["transforms 200 ms late: images given up", _of(late, "given_up")],
        ["... image to pose, p50", f"{late['image_to_pose_ms']['p50']:.0f} ms"],
        [f"{one['malformed']['of_each_topic']} malformed messages on each of {len(one['malformed']['topics'])} topics:"
         f" refused by {'; '.join(f'`{name}`' for name in refused)}",
         "; ".join(str(sum(each.values())) for each in refused.values())],
        [f"bag looped {one['looped_bag']['loops']:.0f} times: frames lost", one["looped_bag"]["lost"]],
        ["two sensors: frames answered",
         " and ".join(_of(each, "answered") for each in one["two_sensors"].values())],
        [f"disk full: files left half written by {len(one['full_disk']['writers'])} writers",
         one["full_disk"]["left_behind"]],
        [f"{steps['steps']} filter steps: deviation from a rotation; growth",
         f"{steps['orthonormality']:.0e}; {steps['resident_mb']['growth']:.1f} MiB"],
    ]  # fmt: skip
    return listed(("what", "[soak]"), rows)


def _of(sent: dict, key: str) -> str:
    return f"{sent[key]} of {sent['sent']}"
