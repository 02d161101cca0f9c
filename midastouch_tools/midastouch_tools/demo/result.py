"""Result of a run of the demo, and its page with the calibration of a simulated sensor."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from midastouch_common import se3
from midastouch_common.mesh import ObjectMesh
from midastouch_common.pose_metric import closest_mode_error, particle_rmse, pose_errors
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses
from midastouch_perception.rendering.renderer import PenetrationRenderer
from midastouch_perception.sensor_calibration.fit import Result, calibrate
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.symmetry.group import Symmetry
from midastouch_perception.tdn import load_tdn
from midastouch_simulation.camera import no_contact_image
from midastouch_simulation.simulated_digit import PressedSensor

from ..bags.run_record import RunRecord, Snapshot
from ..drawing.calibration import TITLES, PenetrationRow, figure_rows, measured_with, penetration_figure
from ..drawing.figures import save
from ..drawing.page import Page
from ..drawing.run_pictures import add_run
from ..text_table import number
from . import NODES

_RADIUS = 3e-3  # m
_SEED = 6  # of a sensor on which the network alone measures too deep
_PRESSES, _TOUCHES = 10, 6
_FIRM = ContactSampling(press=(0.6e-3, 1.4e-3), free_fraction=0.0)


def calibrated_touches(mesh: ObjectMesh) -> tuple[Result, list[PenetrationRow]]:
    """Return a calibration, and touches of the mesh: as measured before and after it, and in truth."""
    rng = np.random.default_rng(_SEED)
    sensor = SensorModel.load("digit_real")
    digit = PressedSensor(sensor, no_contact_image(sensor, rng)[None], _RADIUS, rng)
    result = calibrate(digit.presses(_PRESSES), digit.background, 2 * _RADIUS, sensor, diameter_is_right=True)
    tdn = load_tdn("fast", sensor)
    rows = []
    for truth in PenetrationRenderer(mesh, sensor).render(sample_contact_poses(mesh, _TOUCHES, rng, sensor, _FIRM)):
        image = digit.image_of(truth)
        measured = [measured_with(tdn, each, image, digit.background) for each in (None, result.calibration)]
        tdn.calibration = None
        change = tdn.difference(image, digit.background)
        rows.append(PenetrationRow("image", image, change, (*measured, truth)))
    return result, rows


def write_page(run: list[Snapshot], mesh: ObjectMesh, codebook: Codebook, result: dict, out: Path) -> Path:
    """Draw the frames of a run into the folder `out`; returns its `index.html`."""
    page = Page(f"MidasTouch demo: {mesh.name}")
    page.note(in_a_sentence(f"A simulated sensor slid over {mesh.name}", result))
    add_run(page, result_rows(result), run, mesh, codebook, out)
    _add_calibration(page, mesh, out)
    page.heading("Next: a finger that explores by itself")
    page.note("This slide was made beforehand. Here a simulated finger decides itself where to touch, until it knows:")
    page.code("midastouch run explore")
    page.note("Its tutorial: docs/tutorials/without_hardware.md")
    return page.write(out / "index.html")


def _add_calibration(page: Page, mesh: ObjectMesh, out: Path) -> None:
    """Add touches of the same object by a simulated sensor unlike the network's, before and after calibration."""
    calibration, rows = calibrated_touches(mesh)
    page.heading("A sensor that is calibrated")
    page.note(
        "Every DIGIT shows a touch in other colours. The network alone reads this simulated one too deep. Below are "
        "the same touches of the object before and after midastouch calibrate with ten presses of a ball."
    )
    page.table(["on other presses, median", "before", "after", "truth"], figure_rows(calibration))
    figure = save(penetration_figure(rows, TITLES), out / "calibration.png")
    page.picture(figure, "Touches before and after calibration")


_FOUND_MM, _FOUND_DEG = 10, 15
_WORK = {"tdn": "image to penetration map", "tcn": "penetration map to code", "particle_filter": "code to pose"}
_MOST_NAMED = 6  # places in a cell of a table


def demo_result(record: RunRecord, object_name: str, seconds: float) -> dict:
    """Return the content of `result.json`; seconds: from the first answer to the last.

    `found_s`, `last_s` [s]: the first right answer in the state converged, None without one, and the last answer, both
    since the first image and by the stamps. Errors are modulo the object's symmetry. `alike` [m, quaternion]: all poses
    that touch cannot distinguish from the published one; if rotations are free, one pose for each family of them.
    """
    last = record.snapshots[-1]
    modes = np.array([mode.pose for mode in last.modes]).reshape(-1, 4, 4)
    errors = {
        "published pose": _error(last),
        "closest mode": _in_units(closest_mode_error(modes, last.truth)),
        "particles": _in_units(particle_rmse(last.particles, last.truth)),
    }
    right = (one.time for one in record.snapshots if one.state == "converged" and is_found(_error(one)))
    stage_ms = {**record.node_ms, "particle_filter": float(np.mean([one.filter_ms for one in record.snapshots]))}
    return {
        "object": object_name,
        "frames": len(record.snapshots),
        "found_s": next(right, None),
        "last_s": last.time,
        "final": errors,
        "symmetry": last.symmetry.as_json(),
        "alike": [] if last.estimate is None else se3.to_xyzquat(last.symmetry.transforms @ last.estimate).tolist(),
        "state": last.state,
        "n_particles": last.n_particles,
        "n_modes": len(last.modes),
        "stage_ms": {name: stage_ms[name] for name in NODES if name in stage_ms},
        "hz": (len(record.snapshots) - 1) / seconds if seconds > 0 else None,
    }


def _error(one: Snapshot) -> dict:
    return _in_units((np.nan, np.nan) if one.estimate is None else pose_errors(one.estimate, one.truth))


def _in_units(error: tuple) -> dict:
    return {"trans_mm": 1e3 * float(error[0]), "rot_deg": float(np.degrees(error[1]))}


def is_found(error: dict) -> bool:
    """Return whether an error of a result, `trans_mm` and `rot_deg`, is small enough to count as the right pose."""
    return error["trans_mm"] <= _FOUND_MM and error["rot_deg"] <= _FOUND_DEG


def _alike_in_words(symmetry: Symmetry, alike: list[list[float]]) -> str:
    """Describe the poses `alike` (K, 7), and the free rotations that lead from them to others."""
    if symmetry.free == "all":
        return f"{symmetry.describe()}: any turn about its centre, {_place(symmetry.centre)} mm"
    places = ", ".join(_place(pose[:3]) for pose in alike[:_MOST_NAMED])
    more = f" and {len(alike) - _MOST_NAMED} more" if len(alike) > _MOST_NAMED else ""
    words = f"{symmetry.describe()}: at {places}{more} mm" if alike else symmetry.describe()
    if symmetry.free == "none":
        return words
    axis = ", ".join(f"{x:.2f}" for x in symmetry.axis)
    return f"{words}, and by any turn about the axis ({axis}) through {_place(symmetry.centre)} mm"


def _place(point: Iterable[float]) -> str:
    return f"({', '.join(str(round(1e3 * x)) for x in point)})"


def in_a_sentence(done: str, result: dict) -> str:
    """Return a sentence on what was done, when the pose was found, and how far off it was in the end."""
    if result["found_s"] is None:
        return f"{done}: in {result['last_s']:.1f} s the filter was never both sure of its place and right."
    found, off = f"{result['found_s']:.1f} s", _in_words(result["final"]["published pose"])
    return (
        f"{done}: after {found} the filter was sure of its place on the object, and right; at the end it was {off} off."
    )


def _in_words(error: dict) -> str:
    return f"{number(error['trans_mm'])} mm, {number(error['rot_deg'])} deg"


def result_rows(result: dict) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the table of a result."""
    rows = [[f"{name}, final error", _in_words(error)] for name, error in result["final"].items()]
    rows += [[_WORK[name], f"{number(ms)} ms an image"] for name, ms in result["stage_ms"].items() if ms > 0]
    symmetry = Symmetry.from_json(result["symmetry"])
    if not symmetry.trivial:
        known = "known up to symmetry, and judged so" if result["state"] == "converged" else "judged up to symmetry"
        rows.append([known, _alike_in_words(symmetry, result["alike"])])
    rows.append(
        ["images with an estimate", f"{result['frames']}, {number(result['hz'])} a second on the machine's clock"]
    )
    rows.append(["state", f"{result['state']}, hypotheses: {result['n_particles']}, modes: {result['n_modes']}"])
    return [result["object"], ""], rows
