"""Tables of speed, load and faults."""

from __future__ import annotations

from midastouch_benchmark.speed.scaling import scaling_table

from .cells import part_of, percent
from .reports import UNMEASURED, Table, report, reported

_LIGHTS = ("additive", "relative")
_SIZES = ("50000", "10000", "1000")


def _two(first: dict, second: dict) -> str:
    return f"{first['p50']:.1f}; {second['p50']:.1f} ms"


def speed() -> Table:
    """Each stage on two shared cores."""
    one = report("bench")
    step, fine = one["filter_ms"], one["fine_stage_ms"]
    rows = [
        ["depth network, p50", f"{one['tdn_ms']['p50']:.1f} ms"],
        ["code network, p50", f"{one['tcn_ms']['p50']:.1f} ms"],
        ["filter step with 50k; 10k; 1k particles, p50", "; ".join(f"{step[n]['p50']:.1f}" for n in _SIZES) + " ms"],
        ["fine stage with 50k; 1k particles, p50", "; ".join(f"{fine[n]['p50']:.1f}" for n in _SIZES[::2]) + " ms"],
        ["image to estimate with 50k particles", f"{one['end_to_end_hz']:.0f} Hz"],
        ["image to estimate once converged", f"{one['converged_hz']:.0f} Hz"],
        [
            "look-up of 50k particles: spread; converged",
            _two(one["lookup_ms"]["50000"], one["lookup_converged_ms"]["50000"]),
        ],
        [
            "... that finds the exact nearest entry",
            f"{percent(one['lookup_exact_share']['spread'], 1)}; {percent(one['lookup_exact_share']['converged'])}",
        ],
        ["renders of 240 x 320", f"{one['renders_per_s']:.0f} a second"],
        [
            "simulated images of `digit_sim` on one core: additive; relative light",
            "; ".join(f"{1e3 / one['sim_image_ms'][light]['cpu']:.0f}" for light in _LIGHTS) + " a second",
        ],
        ["codebook poses", f"{one['codebook_poses_per_s']:.0f} a second"],
        ["the paper's networks, FCRN; MinkLoc3D", f"{one['fcrn_ms']['p50']:.0f}; {one['minkloc3d_ms']['p50']:.0f} ms"],
        [
            "the filter's process: active after, p50; longest",
            f"{one['filter_start_s']['p50']:.1f}; {one['filter_start_s']['max']:.1f} s",
        ],
        ["... its memory then", f"{one['filter_rss_mb']:.0f} MiB"],
        [
            "age of an image when its transform is found, beside 500 Hz of transforms: p50; p95",
            f"{one['pose_age_ms']['p50']:.0f}; {one['pose_age_ms']['p95']:.0f} ms",
        ],
    ]
    return ["what", "[bench]"], rows


def scaling() -> Table:
    """Time and memory of the filter over particles and codebook poses."""
    if "scale" not in reported():
        header, _ = scaling_table([])
        return [*header, "report"], [[UNMEASURED, *["-"] * len(header)]]
    header, rows = scaling_table(report("scale")["scaling"])
    return [*header, "report"], [[*row, "[scale]"] for row in rows]


def load() -> Table:
    """Images at the sensor's rate, over the time that the paper's depth network takes on the same machine."""
    header = ["object", "minutes", "images answered", "image to pose, p50; p99", "over FCRN's time"]
    rows, fcrn = [], report("bench")["fcrn_ms"]["p50"]
    for name in ("load_eyebolt", "load_mug"):
        one = report(name)
        times = [one["load"]["image_to_pose_ms"][share] for share in ("p50", "p99")]
        rows.append([
            one["object"], f"{one['minutes']:.0f}", part_of(one["load"]["answered"], one["load"]["sent"]),
            "{:.0f}; {:.0f} ms".format(*times), "{:.3f}; {:.2f}".format(*(each / fcrn for each in times)), f"[{name}]",
        ])  # fmt: skip
    return [*header, "report"], rows


def soak() -> Table:
    """Load and faults."""
    one = report("soak")
    load, killed, late, plug = one["load"], one["killed"], one["transforms_200_ms_late"], one["unplugged"]
    steps, refused = one["filter"], one["malformed"]["refused"]
    milliseconds, rss = load["image_to_pose_ms"], load["resident_mb"]
    rows = [
        [f"{load['fps']:.0f} images a second for {load['seconds'] / 60:.0f} minutes: answered by a pose",
         part_of(load["answered"], load["sent"])],
        ["... image to pose, p50; p99", f"{milliseconds['p50']:.0f}; {milliseconds['p99']:.0f} ms"],
        ["... growth of `tdn`; `tcn`; `particle_filter`",
         "; ".join(f"{rss[n]['growth']:.1f}" for n in ("tdn", "tcn", "particle_filter")) + " MiB"],
        *([f"`{name}` killed: first pose after", f"{each['back_after_s']:.1f} s"] for name, each in killed.items()),
        [f"sensor unplugged for {plug['for_s']:.0f} s: ERROR; `stale`; pose again after",
         f"{plug['error_after_s']:.1f}; {plug['stale_after_s']:.1f}; {plug['back_after_s']:.1f} s"],
        ["transforms 200 ms late: images given up", part_of(late["given_up"], late["sent"])],
        ["... image to pose, p50", f"{late['image_to_pose_ms']['p50']:.0f} ms"],
        [f"{one['malformed']['of_each_topic']} malformed messages on each of {len(one['malformed']['topics'])} topics:"
         f" refused by {'; '.join(f'`{name}`' for name in refused)}",
         "; ".join(str(sum(each.values())) for each in refused.values())],
        [f"bag looped {one['looped_bag']['loops']:.0f} times: frames lost", one["looped_bag"]["lost"]],
        ["two sensors: frames answered",
         " and ".join(part_of(each["answered"], each["sent"]) for each in one["two_sensors"].values())],
        [f"disk full: files left half written by {len(one['full_disk']['writers'])} writers",
         one["full_disk"]["left_behind"]],
        [f"{steps['steps']} filter steps: deviation from a rotation; growth",
         f"{steps['orthonormality']:.0e}; {steps['resident_mb']['growth']:.1f} MiB"],
    ]  # fmt: skip
    return ["what", "[soak]"], rows
