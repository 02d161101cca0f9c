"""Single-touch figures of one object: of its codes, and of comparing each touch with every pose."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.codebook import Codebook
from midastouch_perception.rendering.contact_poses import ContactSampling, sample_contact_poses

from ..statistics.intervals import bootstrap_interval
from ..trials.setup import Networks
from .matches import BOOK, best_matches, exhaustive_matches, mean_summary, single_touch_errors
from .simulated_touch import Lighting, TouchSimulator

OURS = "tcn"
_SAMPLING = ContactSampling(free_fraction=0.0)
MAPS = {"measured_maps": "penetration", "true_maps": "truth"}
"""Maps of `Percepts` with which a touch is compared exhaustively, by the name of the comparison."""
_CELL = 5e-3  # m
_QUANTILES = 501
CELL_COLUMNS = ("x_mm", "y_mm", "z_mm", "normal_x", "normal_y", "normal_z", "error", "touches")


@dataclasses.dataclass(frozen=True)
class SingleTouchPlan:
    """Settings of a single-touch measurement.

    Attributes: queries: number of touches; lighting; exhaustive: touches compared with each pose of a book.
    """

    queries: int
    lighting: Lighting
    exhaustive: int = 0

    @property
    def touches(self) -> int:
        """Number of touches to simulate for one object, for a progress bar."""
        return self.queries + len(MAPS) * self.exhaustive


def measure_object(
    mesh: ObjectMesh,
    codebook: Codebook,
    networks: Networks,
    plan: SingleTouchPlan,
    rng: np.random.Generator,
    progress: Callable[[int], object],
) -> dict:
    """Return one object's entry of the `single-touch` JSON; `errors`: quantiles; `cells`: rows of `CELL_COLUMNS`."""
    simulator = TouchSimulator(mesh, networks, plan.lighting)
    poses = sample_contact_poses(mesh, plan.queries, rng, networks.sensor, _SAMPLING)
    codes, in_contact = simulator.encode(poses, networks.tcn, rng, progress)
    errors = single_touch_errors(codebook.poses, poses, best_matches(codebook.codes, codes), rng)
    return {
        "object": mesh.name,
        "queries": plan.queries,
        "missed": int((~in_contact).sum()),
        "summary": errors.summary(),
        "exhaustive": _exhaustive(simulator, codebook, networks, plan, rng, progress),
        "errors": np.round(np.quantile(errors.six_vector.normalised, np.linspace(0, 1, _QUANTILES)), 3),
        "cells": error_by_place(poses, errors.six_vector.normalised),
    }


def _exhaustive(simulator, codebook, networks, plan, rng, progress) -> dict | None:
    """Return normalised top-25 errors of our codes and each of `MAPS`, by touch, on one book; None if not asked for."""
    if not plan.exhaustive:
        return None
    poses = sample_contact_poses(simulator.mesh, plan.exhaustive, rng, networks.sensor, _SAMPLING)
    percepts = list(simulator.percepts(poses, rng))
    maps = {way: np.concatenate([getattr(one, name) for one in percepts]) for way, name in MAPS.items()}
    chosen = np.sort(rng.choice(len(codebook.poses), min(BOOK, len(codebook.poses)), replace=False))
    book = codebook.poses[chosen]
    codes = np.concatenate([networks.tcn.encode(one.penetration) for one in percepts])
    matches = {OURS: best_matches(codebook.codes[chosen], codes)} | {
        way: exhaustive_matches(simulator.mesh, networks.sensor, book, each, rng, progress)
        for way, each in maps.items()
    }
    seed = int(rng.integers(2**32))  # the same random touches for all
    errors = {way: single_touch_errors(book, poses, each, np.random.default_rng(seed)) for way, each in matches.items()}
    nearest = errors[OURS].nearest / errors[OURS].six_vector.random.mean()
    errors_of = {way: each.six_vector.normalised for way, each in errors.items()}
    return {"book_size": len(chosen), "errors": errors_of | {"nearest_entry": nearest}}


def error_by_place(poses: np.ndarray, errors: np.ndarray) -> list[list[float]]:
    """Return the mean error of the touches in each 5 mm of the surface, one row of `CELL_COLUMNS` for each cell.

    Cells are of place and, coarsely, of normal, which separates the two sides of a thin plate.
    """
    place, normal = poses[:, :3, 3], np.rint(poses[:, :3, 2])
    keys, cell = np.unique(np.hstack([np.rint(place / _CELL), normal]), axis=0, return_inverse=True)
    cell = cell.ravel()
    touches = np.bincount(cell)
    mean = [np.bincount(cell, value) / touches for value in (*(1e3 * place.T), errors)]
    columns = [*(np.round(m, 1) for m in mean[:3]), *keys[:, 3:].astype(int).T, np.round(mean[3], 3), touches]
    return [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def summarise_objects(objects: list[dict]) -> dict:
    """Return the fields of one object as means over all of them (`missed`: their sum), and the `objects`."""
    name = objects[0]["object"] if len(objects) == 1 else f"mean of {len(objects)} objects"
    return {
        "object": name,
        "queries": objects[0]["queries"],
        "missed": sum(one["missed"] for one in objects),
        "summary": mean_summary([one["summary"] for one in objects]),
        "exhaustive": _limits(objects),
        "cell_columns": CELL_COLUMNS,
        "objects": objects,
    }


def _limits(objects: list[dict]) -> dict | None:
    """Return by comparison: trials, the touches of all objects; error, the mean of their normalised errors; over_codes,
    the mean excess over our codes on the same touches."""
    known = [one["exhaustive"]["errors"] for one in objects if one["exhaustive"]]
    if not known:
        return None
    errors = {way: np.concatenate([one[way] for one in known]) for way in known[0]}
    return {
        way: {"trials": len(each), "error": _with_interval(each), "over_codes": _with_interval(each - errors[OURS])}
        for way, each in errors.items()
    }


def _with_interval(values: np.ndarray) -> dict:
    return {"value": float(values.mean()), "interval": bootstrap_interval(values, range(len(values)))}
