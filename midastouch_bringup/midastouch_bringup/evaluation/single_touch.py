"""Single-touch localisation: how near the codebook's best matches for one touch are to where it was.

Paper section 4.2, figures 4 and 14: for each query the 25 highest scores are taken from the codebook, the
smallest of their pose errors counts, divided by the error of a randomly drawn touch.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.simulation.contact_poses import sample_contact_poses
from midastouch_perception.simulation.optics import TactoOptics
from midastouch_perception.simulation.renderer import PenetrationRenderer

from ..slide_simulation import no_contact_image
from .metrics import geodesic_distances, six_vectors
from .setup import Networks

TOP = 25
_TOUCHES_PER_SENSOR = 20


@dataclasses.dataclass(frozen=True)
class SingleTouchErrors:
    """Per query: smallest error among the best 25 matches and error of a random touch, each (Q,) [m]; once
    with the paper's 6-vectors, once with the geodesic angle."""

    best: np.ndarray
    random: np.ndarray
    geodesic_best: np.ndarray
    geodesic_random: np.ndarray

    def summary(self) -> dict[str, float]:
        """The `summary` of the `single-touch` JSON: errors divided by the mean error of a random touch."""
        normalised = self.best / self.random.mean()
        return {
            "normalised_top25_error": float(normalised.mean()),
            "median": float(np.median(normalised)),
            "random_error": float(self.random.mean()),
            "geodesic_normalised_top25_error": float(self.geodesic_best.mean() / self.geodesic_random.mean()),
        }


def single_touch_errors(
    book_poses: np.ndarray,
    book_codes: np.ndarray,
    query_poses: np.ndarray,
    query_codes: np.ndarray,
    rng: np.random.Generator,
) -> SingleTouchErrors:
    """Errors of queries, poses (Q, 4, 4) with unit codes (Q, D), against a book (M, 4, 4) with (M, D).

    The random touch is one entry of the book, drawn uniformly for each query.
    """
    top = min(TOP, len(book_poses))
    book_vectors, query_vectors = six_vectors(book_poses), six_vectors(query_poses)
    drawn = rng.integers(len(book_poses), size=len(query_poses))
    best = np.empty(len(query_poses))
    geodesic_best = np.empty(len(query_poses))
    for i in range(len(query_poses)):
        scores = book_codes @ query_codes[i]
        match = np.argpartition(-scores, top - 1)[:top]
        best[i] = np.linalg.norm(book_vectors[match] - query_vectors[i], axis=1).min()
        geodesic_best[i] = geodesic_distances(book_poses[match], query_poses[i]).min()
    return SingleTouchErrors(
        best,
        np.linalg.norm(book_vectors[drawn] - query_vectors, axis=1),
        geodesic_best,
        geodesic_distances(book_poses[drawn], query_poses),
    )


def simulated_touches(
    mesh: ObjectMesh,
    networks: Networks,
    n: int,
    rng: np.random.Generator,
    progress: Callable[[int], object] = lambda touches: None,
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n, 4, 4) and codes (n, D) of touches seen by simulated sensors, a new one for every 20 touches.

    Only touches that the pipeline takes for contacts are kept; drawn until there are n of them. Raises
    InputError if the networks see (almost) none.
    """
    optics, renderer = TactoOptics(networks.sensor), PenetrationRenderer(mesh, networks.sensor)
    poses, codes, drawn = [], [], 0
    while len(codes) < n:
        background = no_contact_image(networks.sensor, rng)
        pipeline = networks.pipeline()
        for pose in sample_contact_poses(mesh, _TOUCHES_PER_SENSOR, rng, networks.sensor):
            penetration, normals = renderer.render_with_normals(pose[None])
            drawn += 1
            touch = pipeline.process(optics.image(penetration[0], background, rng, normals[0]), background)
            if touch.in_contact and touch.code is not None and len(codes) < n:
                poses.append(pose)
                codes.append(touch.code)
                progress(1)
        if drawn >= 10 * _TOUCHES_PER_SENSOR and len(codes) < 0.05 * drawn:
            raise InputError(f"{mesh.name}: {drawn} touches, {len(codes)} of them felt; does the mesh fit the sensor?")
    return np.array(poses), np.array(codes)
