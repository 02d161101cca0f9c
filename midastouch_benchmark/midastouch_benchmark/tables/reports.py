"""Committed reports, and the commands that make them."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

from ..evidence import fingerprint
from ..statistics.accuracy import counted_anew
from ..trials.protocols import PROTOCOLS
from ..trials.variants import DEFAULT

ROOT = Path(__file__).resolve().parents[3]
_BENCHMARK = "midastouch benchmark --meshes ../shared/meshes/ycb"
_OBSERVER = "midastouch ideal-observer --evidence maps --meshes ../shared/meshes/ycb"
_PLAIN = "--init paper --slides 10 --seeds 1 --stride 2 --codebook-size 10000"
_REAL = f"{_PLAIN} --sensor digit_real"
_SLIDES = "../shared/data/ycb_slide_sim"
_LOAD = ".venv/bin/python -m pytest midastouch_tools/test/soak/test_load.py -k sensors_rate"
_TEN = "../shared/meshes/ycb/{004,005,006,021,025,035,037,042,048,055}_*.ply"
_PERCEPTION = "midastouch evaluate-perception"
_PRESSES = (
    ("d20641", "digit_real/sphere_presses_d20641", "--ball-diameter 0.0088 --px-per-mm 18.68", " --check-labels"),
    ("vocdex", "digit_real/sphere_presses_vocdex", "--ball-diameter 0.006", " --check-labels"),
    ("mini_6310", "gelsight_mini/presses_6310", "--sensor gelsight_mini --ball-diameter 0.00631", ""),
    ("mini_9500", "gelsight_mini/presses_9500", "--sensor gelsight_mini --ball-diameter 0.0095", ""),
)
"""Real presses of a ball: name, folder, options, and whether there are labels to check."""
_BOOKS_OF_SLIDES = "midastouch build-codebook ../shared/meshes/ycb/{005,025,035}_*.ply"
_SINGLE_TOUCH = f"midastouch build-codebook {_TEN} && midastouch single-touch {_TEN}"
_OTHER_TABLES = ("plain", "uniform", "grasp", "pinch", "real_sensor", "real_sensor_calibrated", "camera_faults")
CONDITIONS = {name: protocol.summary for name, protocol in PROTOCOLS.items() if name not in _OTHER_TABLES}
"""Condition of the slides, by the name of the protocol and of its report."""
_PAIRED = "--slides 10 --seeds 1"  # 100 trials of each variant; another seed changes only what the belief draws
FURTHER = {
    "held_out": ("ten further objects", _PAIRED),
    "cad": ("CAD parts", "--slides 4 --seeds 1 --codebook-size 10000"),
}
"""Further sets of objects by their name in `--objects`: label, and options of the slides over each object."""


def _evenly(command: str) -> str:
    """Return the command, with three slides for each of the four differences if the protocol is `other_shape`."""
    return command.replace("--slides 10", "--slides 12") if "--protocol other_shape" in command else command


_ABLATIONS = {
    "kidnap": "no_lift",
    "tool_bias": "no_drift",
    "push": "no_drift",
    "rest": "no_rest_gate",
    "slow_camera": "no_repeat_gate",
}
"""Variants that are run under a protocol which exercises them."""
COMMANDS = {
    "accuracy": f"{_BENCHMARK} --init paper {_PAIRED}",
    "accuracy_uniform": f"{_BENCHMARK} --init uniform {_PAIRED}",
    **{name: _evenly(f"{_BENCHMARK} --protocol {name} {_PAIRED}") for name in CONDITIONS},
    **{
        f"{name}_{objects}": _evenly(f"{_BENCHMARK} --objects {objects} --protocol {name} {slides}")
        for objects, (_, slides) in FURTHER.items()
        for name in ("plain", "uniform", *CONDITIONS)
        if name != "small_parts"
    },
    "small_cad": f"{_BENCHMARK} --objects small_cad --protocol small_parts {_PAIRED}",
    "identify": "midastouch identify --meshes ../shared/meshes/ycb --slides 10",
    "identify_cad": "midastouch identify --objects cad --slides 4 --codebook-size 10000",
    "identify_all": "midastouch identify --meshes ../shared/meshes/ycb --objects all --slides 2 --codebook-size 10000",
    "start": "midastouch evaluate-start --meshes ../shared/meshes/ycb --slides 10",
    "peers": f"{_BENCHMARK} --length 0.3 {_PAIRED} --variant peers",
    "observer_uniform": f"{_OBSERVER} --slides 10",
    "observer_kidnap": f"{_OBSERVER} --protocol kidnap --slides 10",
    "observer_cad": "midastouch ideal-observer --evidence maps --objects cad --slides 4",
    "grasp": f"{_BENCHMARK} --protocol grasp --variant contacts {_PAIRED}",
    "grasp_cad": f"{_BENCHMARK} --objects cad --protocol grasp --variant contacts --slides 4 --seeds 1 "
    "--codebook-size 10000",
    "pinch": f"{_BENCHMARK} --protocol pinch {_PAIRED}",
    "pinch_cad": f"{_BENCHMARK} --objects cad --protocol pinch --slides 4 --seeds 1 --codebook-size 10000",
    "real_plain": f"{_BENCHMARK} {_PLAIN}",
    "real_sensor": f"{_BENCHMARK} {_REAL} --protocol real_sensor",
    "real_sensor_calibrated": f"{_BENCHMARK} {_REAL} --protocol real_sensor_calibrated",
    "camera_faults": f"{_BENCHMARK} --slides 64 --seeds 1 --stride 2 --sensor digit_real --protocol camera_faults",
    "ablation": f"{_BENCHMARK} --init uniform --length 0.3 {_PAIRED} --variant no_maps no_codes no_drift",
    **{
        f"ablation_{protocol}": f"{_BENCHMARK} --protocol {protocol} {_PAIRED} --variant {variants}"
        for protocol, variants in _ABLATIONS.items()
    },
    "front": f"{_BENCHMARK} --init uniform --length 0.3 {_PAIRED} --variant front",
    "evaluate_paper": f"{_BOOKS_OF_SLIDES} && midastouch evaluate {_SLIDES}/*/00 --init paper",
    "evaluate_uniform": f"{_BOOKS_OF_SLIDES} && midastouch evaluate {_SLIDES}/035_power_drill/00 --init uniform",
    "evaluate_tdn": f"{_PERCEPTION} tdn {_SLIDES}/*/00",
    "evaluate_tdn_held_out": "for name in 019_pitcher_base 032_knife 043_phillips_screwdriver 052_extra_large_clamp "
    "065-c_cups 072-b_toy_airplane 073-a_lego_duplo; do [ -d out/held_out/$name ] || midastouch simulate "
    f"../shared/meshes/ycb/$name.ply --seed 7 --out out/held_out/$name; done && {_PERCEPTION} tdn out/held_out/*",
    **{
        f"presses_{name}{made}": f"{_PERCEPTION} presses ../shared/data/{folder} {ball}{how}{labels}"
        for name, folder, ball, labels in _PRESSES
        for made, how in (("", ""), ("_calibrated", " --calibrate-with 10"))
    },
    "checks": f"{_PERCEPTION} checks ../shared/data/digit_backgrounds --sensors 100 "
    "--colour-table ../shared/data/digit_real/taxim_digit/polycalib.npz "
    "--presses ../shared/data/digit_real/ball_presses ../shared/data/digit_real/sphere_presses_d20641 "
    "../shared/data/digit_real/sphere_presses_vocdex",
    "ramps": f"{_PERCEPTION} ramps --presses 12",
    "soft_gel": f"{_PERCEPTION} gel --meshes ../shared/meshes/ycb --touches 20",
    "single_touch": f"{_SINGLE_TOUCH} --queries 2000",
    "single_touch_random": f"{_SINGLE_TOUCH} --queries 500 --lighting random "
    "--backgrounds ../shared/data/digit_backgrounds",
    "single_touch_limit": f"{_SINGLE_TOUCH} --queries 100 --exhaustive 15",
    "exploration": "midastouch evaluate-exploration --meshes ../shared/meshes/ycb --trials 10 "
    "--policy suggested lifts random",
    "exploration_arm": "midastouch evaluate-exploration --meshes ../shared/meshes/ycb --trials 10 --policy arm",
    "motion": "midastouch evaluate-motion --meshes ../shared/meshes/ycb --trials 14",
    "bench": "midastouch bench --paper-networks",
    "scale": "midastouch bench-scale",
    "soak": "make soak MINUTES=1",
    "load_eyebolt": f"SOAK_MINUTES=10 {_LOAD}",
    "load_mug": f"SOAK_MINUTES=5 SOAK_MESH=../shared/meshes/ycb/025_mug.ply {_LOAD}",
}
STARTS = {"accuracy": "start as the paper's", "accuracy_uniform": "nothing known at the start"}
ABLATIONS = {"ablation": STARTS["accuracy_uniform"]} | {f"ablation_{name}": CONDITIONS[name] for name in _ABLATIONS}
"""Condition of the slides, by the name of the report on variants without a part of the filter."""
OPTICS = {
    "real_plain": "TACTO's, on its own sensor",
    "real_sensor": "of two real sensors, not calibrated",
    "real_sensor_calibrated": "of the same, calibrated with ten presses each",
}
NO_ESTIMATES = ("soak", "load_eyebolt", "load_mug")
"""Reports on load and faults of the nodes, which hold no estimates and are never stale."""


def report_path(name: str) -> Path:
    """Return the path of the newest report of that name; FileNotFoundError if there is none."""
    found = sorted((ROOT / "reports").glob(f"*/{name}.json"))
    if not found:
        raise FileNotFoundError(f"no reports/*/{name}.json, made by: {COMMANDS[name]}")
    return found[-1]


def reported() -> list[str]:
    """Return the names of the reports that exist; within `only_of_today`, of those that today's code made."""
    files = {path.stem for path in (ROOT / "reports").glob("*/*.json")}
    there = [name for name in COMMANDS if name in files]
    old = set(stale(there)) if _only_of_today else set()
    return [name for name in there if name not in old]


def report(name: str) -> dict:
    """Return the content of a report, not to be changed; FileNotFoundError if `reported` does not name it."""
    for names in _readers:
        names.add(name)
    if _only_of_today and stale([name]):
        raise FileNotFoundError(f"reports/*/{name}.json: of earlier code; made by: {COMMANDS[name]}")
    return _content(report_path(name))


@cache
def _content(path: Path) -> dict:
    return json.loads(path.read_text())


_readers: list[set[str]] = []
_only_of_today: list[bool] = []


@contextlib.contextmanager
def only_of_today() -> Iterator[None]:
    """Treat reports of earlier code as missing within the context."""
    _only_of_today.append(True)
    try:
        yield
    finally:
        _only_of_today.pop()


@contextlib.contextmanager
def names_read() -> Iterator[set[str]]:
    """Collect the names of the reports that are read within the context."""
    names: set[str] = set()
    _readers.append(names)
    try:
        yield names
    finally:
        _readers.remove(names)


@cache
def ids_of_today() -> dict[str, str]:
    """Return the ids of `reports/fingerprint.json` by part; none if there is no such file."""
    return fingerprint.read()[1] if fingerprint.COMMITTED.is_file() else {}


def fingerprint_of(name: str) -> str | None:
    """Return the fingerprint of the code that made a report; None if it stores none, or does not exist."""
    try:
        return _content(report_path(name)).get("fingerprint")
    except FileNotFoundError:
        return None


def stale(names: Iterable[str]) -> list[str]:
    """Return the names of reports that other code than today's made, or that store no fingerprint or do not exist."""
    known = set(ids_of_today().values())
    return [
        name for name in names if name not in NO_ESTIMATES and not set((fingerprint_of(name) or "").split("+")) <= known
    ]


def benchmark_summary(name: str) -> dict:
    """Return the summary of a benchmark of the filter as shipped, which has one way to start."""
    report(name)  # it may be missing, or of earlier code
    return _summary(report_path(name))


@cache
def _summary(path: Path) -> dict:
    content = _content(path)
    (summary,) = content["summary"][DEFAULT].values()
    return counted_anew(summary, [trial for trial in content["trials"] if trial["variant"] == DEFAULT])


def rows_of(names: Mapping[str, str], record: Callable[[str], Mapping | Iterable[Mapping]] = report) -> list[dict]:
    """Return the rows of a table of reports, with their labels by name: what each record has, `what`, its label,
    `report`, its name, and `measured`; a report that does not exist has a row, too."""
    rows, there = [], reported()
    for name, what in names.items():
        found = record(name) if name in there else {}
        for each in [found] if isinstance(found, Mapping) else found:
            rows.append({"what": what, "report": name, "measured": name in there, **each})
    return rows


def further() -> dict[str, str]:
    """Return the conditions over further sets of objects, by the names of the reports."""
    asked = {"plain": STARTS["accuracy"], "uniform": STARTS["accuracy_uniform"]} | CONDITIONS
    sets = {
        f"{name}_{objects}": f"{what}; {words}"
        for objects, (words, _) in FURTHER.items()
        for name, what in asked.items()
        if name != "small_parts"
    }
    return sets | {"small_cad": f"{CONDITIONS['small_parts']}; a further set"}
