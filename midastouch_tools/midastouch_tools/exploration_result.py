"""Result of an exploration, and its page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook

from .bags.run_record import RunRecord, Snapshot
from .demo.result import demo_result, in_a_sentence, is_found
from .demo.result import result_rows as rows_of_run
from .drawing.figures import identity_figure, save
from .drawing.page import Page
from .drawing.run_pictures import add_run
from .text_table import counted

_TITLE = "A finger explores: "


def write_page(run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, result: dict, out: Path) -> Path:
    """Draw the frames of a run into the folder `out`; returns its `index.html`.

    Frames whose penetration was not recorded, such as the first ones at times, are left out.
    """
    run = [one for one in run if one.penetration is not None]
    if not run:
        return write_words(result, "no frame was recorded with its penetration map", out)
    page = Page(_TITLE + mesh.name)
    page.note(in_a_sentence(f"{mesh.name} was explored", result))
    add_run(page, result_rows(result), run, mesh, codebook, out)
    if any(one.objects for one in run):
        page.picture(save(identity_figure(run), out / "objects.png"), "Which object it is, for the filter")
        page.note("While another object leads, the particles are poses on that one.")
    return page.write(out / "index.html")


def write_words(result: dict, why: str, out: Path) -> Path:
    """Write the page of a run without pictures, with the reason `why`; returns its `index.html`."""
    page = Page(_TITLE + result["object"])
    page.table(*result_rows(result))
    page.note(f"There is nothing to draw: {why}")
    return page.write(out / "index.html")


def end_of(status: Any, by_hand: bool = False) -> dict:
    """Return how an exploration ended, by the keys of `result.json`.

    status: `ExplorerStatus` with the end's state and reason, the path on the surface [m], and the number of motions;
    by_hand: True if a person ended it.
    """
    return {
        "ended": status.state,
        "reason": status.reason,
        "by_hand": by_hand,
        "path_m": status.path_length,
        "slides": status.slides,
        "lifts": status.lifts,
    }


def ending(ended: dict, object_name: str, seconds: float) -> dict:
    """Return the part of `result.json` that every end has, even one before the filter's first answer; ended: as of
    `end_of`; seconds: of the whole run, from the start of the nodes on."""
    return {"object": object_name, "right": False, **ended, "seconds": seconds}


def exploration_result(record: RunRecord, object_name: str, ended: dict, answering: float, seconds: float) -> dict:
    """Return the content of `result.json`: `ending`, and the filter's answers; answering [s]: from its first answer to
    the last."""
    result = demo_result(record, object_name, answering)
    # an object that the filter was given is known
    objects = record.snapshots[-1].objects or {object_name: 1.0}
    answer = max(objects, key=objects.get)
    known = result["state"] == "converged" and answer == object_name
    return {
        **ending(ended, object_name, seconds),
        "right": known and is_found(result["final"]["published pose"]),
        "answer": answer,
        "object_probability": objects[answer],
        **result,
    }


def result_rows(result: dict) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of a result, or of an ending alone."""
    motions = f"{counted(result['slides'], 'slide')}, {counted(result['lifts'], 'lift')}"
    known = result.get("state") == "converged"
    ended = "ended by hand" if result["by_hand"] else f"{result['ended']}: {result['reason']}"
    rows = [
        ["exploration", ended],
        ["the pose is known, and right", "yes" if result["right"] else "no" if known else "not known"],
        ["path on the surface", f"{1e3 * result['path_m']:.0f} mm, {motions}"],
        ["time on the clock, with the start of the nodes", f"{result['seconds']:.0f} s"],
    ]
    if "answer" in result:
        rows.append(["time since the first image, by the stamps", f"{result['last_s']:.1f} s"])
        rows.insert(1, ["object for the filter", f"{result['answer']}, {result['object_probability']:.1%}"])
        rows += rows_of_run(result)[1]
    return [result["object"], ""], rows
