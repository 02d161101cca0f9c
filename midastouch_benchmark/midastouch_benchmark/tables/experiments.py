"""Every kind of result: how it is recognised, on which parts of the fingerprint it depends, and its tables and notes.

The command prints these tables, `midastouch report` puts them on a page, and documents show the same columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import pandas as pd

from ..statistics.comparison import rows_by_init
from ..trials.variants import DEFAULT
from . import accuracy, checks, comparisons, exploring, perception, speed, trust
from .table import Table, listed, text

Titled = tuple[str, pd.DataFrame]


Text = str | Callable[[dict], str]


@dataclass(frozen=True)
class Experiment:
    """A kind of result.

    keys: of its JSON, all of which no kind above it in `EXPERIMENTS` has; parts: of the fingerprint on which it
    depends; tables(content): its tables with their titles; notes(content): lines that belong to them; heading, about:
    of its part of a page, formats of the result or functions.
    """

    keys: tuple[str, ...]
    heading: Text
    tables: Callable[[dict], Iterable[Titled]] = lambda content: ()
    parts: tuple[str, ...] = ("estimates",)
    about: Text = ""
    notes: Callable[[dict], list[str]] = lambda content: []


def written(what: Text, content: dict) -> str:
    """Return a heading or an explanation of a result."""
    return what.format(**content) if isinstance(what, str) else what(content)


def _untitled(*makers: Callable[[dict], pd.DataFrame]) -> Callable[[dict], list[Titled]]:
    return lambda content: [("", make(content)) for make in makers]


_NETWORKS = "networks {config[networks][tdn]}, {config[networks][tcn]}"


def _identified(content: dict) -> pd.DataFrame:
    rows = [
        (t["sequence"], t["answer"], f"{t['confidence']:.0%}", "yes" if t["right"] else f"no: {t['truth']}")
        for t in content["identified"]
    ]
    return listed(("sequence", "answer", "probability", "right"), rows)


def _benchmark(content: dict) -> Iterator[Titled]:
    for init in content["summary"].get(DEFAULT, {}):
        yield from of_start(content, init)
    for init, rows in rows_by_init(content["comparison"]).items():
        if len(rows) > 1:
            yield f"variants, start: {init}", comparisons.compared_table(content | {"comparison": rows})


def of_start(content: dict, init: str) -> Iterator[Titled]:
    """Yield the tables on the filter as shipped with one start, of a result of `midastouch benchmark`."""
    summary = content["summary"][DEFAULT][init]
    symmetries = {one["object"]: one["symmetry"] for one in content["objects"]}
    beside = {"object": "the paper's ten"} | accuracy.PAPER if init == "paper" else None
    trials = [t for t in content["trials"] if t["variant"] == DEFAULT and t["init"] == init]
    rows = [{"what": init} | accuracy.summary_row(summary, trials)]
    enough = summary["trust"]["enough"]
    few = "" if enough else f"; too few trials ({summary['trials']}) to claim anything"
    yield f"start: {init}{few}", accuracy.objects(summary, symmetries, beside)
    if not enough:
        return
    yield "with 95 % intervals", Table({"start": text("what")}, accuracy.LOCALISATION.claims).of(rows)
    yield "what `converged` promises", trust.CONVERGED.of(rows)
    yield "does the covariance hold the truth?", trust.REGIONS.of(rows)
    yield "is the published pose right, by the weight of its mode?", trust.weights_table({"right": summary["trust"]})
    if any(t["event_at"] is not None for t in trials):
        yield "around the event", trust.AROUND_EVENT.of(rows)
    if summary["held"]:
        words = {name: content["variants"][name]["summary"] for name in content["summary"]}
        held = {words[name]: by_init[init]["held"] for name, by_init in content["summary"].items()}
        yield "held still", comparisons.grasps_table(held)
    methods = comparisons.methods_table(content, init)
    if len(methods) > 1:
        yield "methods on the same slides", methods


def _campaign(content: dict) -> str:
    config = content["config"]
    return (
        f"{len(config['slides'])} slides of {config['slide_length_m']:g} m each, {len(config['seeds'])} seeds, "
        f"beta {config['beta']:g}, stride {config['stride']}, codebooks of {config['codebook_size']} poses, "
        f"{config['jobs']} processes; {_NETWORKS.format(**content)}; {content['missing_trials']} trials missing"
    )


def _identification(content: dict) -> Iterator[Titled]:
    if summary := content["identification"]:  # none before the first trial
        row = {"what": f"of {summary['objects']}"} | exploring.identification_row(summary)
        yield "which object", exploring.IDENTIFICATION.of([row])


def _confusions(content: dict) -> list[str]:
    answers = content["identification"]["answers"] if content["identification"] else {}
    return [f"{answer}: {times}" for answer, times in answers.items()] or ["no answer is wrong"]


def _left_out(content: dict) -> list[str]:
    """Return a line for each image of a press that was left out, with the reason."""
    notes = [f"{each['image']}: not used: {each['problem']}" for each in content.get("unusable", ())]
    notes += [f"{each['image']}: depth not judged: {each['problem']}" for each in content.get("unfitted", ())]
    if problem := content.get("depth_problem"):
        notes.append(f"depth cannot be judged: no circles.csv, and the images do not tell where the ball is: {problem}")
    return notes


def _single_touch(content: dict) -> Iterator[Titled]:
    yield "", perception.single_touch_table(content)
    if limits := content.get("exhaustive"):
        yield "compared with every pose", perception.single_touch_limits(limits)


EXPERIMENTS = {
    "evaluate": Experiment(
        ("sequences", "trials"),
        "Localisation",
        _untitled(lambda content: accuracy.objects(content["summary"], beside=accuracy.real_row(content))),
        about=f"init {{config[init]}}, beta {{config[beta]:g}}, stride {{config[stride]}}; {_NETWORKS}",
    ),
    "evaluate --objects": Experiment(("identified",), "Which object it is", _untitled(_identified)),
    "benchmark": Experiment(
        ("comparison",),
        lambda content: f"Accuracy over {len(content['objects'])} objects, protocol {content['config']['protocol']}",
        _benchmark,
        about=_campaign,
    ),
    "identify": Experiment(
        ("identification",),
        "Which object",
        _identification,
        about=lambda content: f"catalogue: {', '.join(content['catalogue'])}",
        notes=_confusions,
    ),
    "ideal-observer": Experiment(
        ("ideal_observer",), "Against the ideal observer", _untitled(exploring.observing_table)
    ),
    "evaluate-exploration": Experiment(("exploration",), "Where to touch next", _untitled(exploring.exploration_table)),
    "evaluate-start": Experiment(
        ("start",),
        "A new mesh",
        notes=lambda content: [
            "{trials} first touches of {objects} objects: a pose after {first_pose_s[value]:.1f} s (median; at most "
            "{first_pose_s[max]:.1f} s)".format(**content["start"])
        ],
    ),
    "evaluate-perception tdn": Experiment(
        ("sequences", "summary"), "Depth network", _untitled(perception.depth_table), ("perception",)
    ),
    "evaluate-perception gel": Experiment(
        ("touches",), "Soft gel", _untitled(perception.soft_gel, perception.commanded_depth), ("real_gel",)
    ),
    "evaluate-perception presses": Experiment(
        ("presses",),
        "Real presses of a ball",
        _untitled(perception.presses_table),
        ("real_gel",),
        "The ideal contact is the cap of a ball of the true size under the contact's outline: the labelled circle or, "
        "without labels, the one that the images show. If they show none, it is the measured outline, which flatters "
        "the network: do not judge depth by it. A good network has peak ratio and correlation near 1, and measures the "
        "true radius.",
        _left_out,
    ),
    "evaluate-perception ramps": Experiment(
        ("ramps",), "What is pressed is felt", _untitled(checks.ramps), ("perception", "real_gel")
    ),
    "evaluate-perception checks": Experiment(
        ("fit_check",),
        "Checks on tactile images",
        lambda content: [("", table) for table in checks.check_tables(content)],
        ("real_gel",),
        "network {network}, sensor {sensor}: {sensors} imaginary sensors over {no_contact_images} real no-contact "
        "images; areas under the ROC curve are against the sensors that are right",
    ),
    "evaluate-perception guards": Experiment(
        ("guards",), "Frames that are refused", _untitled(checks.guards), ("perception",)
    ),
    "single-touch": Experiment(
        ("queries",),
        "Single touch",
        _single_touch,
        ("perception",),
        lambda content: (
            f"{content['config']['lighting']} lighting, backgrounds "
            f"{content['config']['backgrounds'] or 'invented'}; {_NETWORKS.format(**content)}"
        ),
        perception.single_touch_notes,
    ),
    "bench": Experiment(
        ("tdn_ms",),
        "Speed",
        _untitled(speed.stages, speed.rates),
        about="{threads} cores, codebook of {codebook_size} poses",
    ),
    "bench-scale": Experiment(
        ("scaling",),
        "Time and memory of the filter, on {object}",
        _untitled(lambda content: speed.SCALING.of(content["scaling"])),
        about="{frames} frames, {threads} cores; nothing is known at the start",
    ),
    "evaluate-motion": Experiment(
        ("trials", "missing_trials"),
        "An arm that touches",
        _untitled(exploring.motion_table, exploring.fault_table),
        ("perception",),
    ),
}
"""Kinds of results by the command that makes them, in the order in which a page shows them."""
