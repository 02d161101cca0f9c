"""Where the codebook's entries lie: evenly over the reachable surface, evenly in yaw, more of them on edges."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from .rendering.contact_poses import Reachability, pose_from_contact, touch_points
from .sensor_model import SensorModel

PRESS = 1e-3  # m, penetration of every entry: the codes are trained to match a touch of any press with it
YAWS = 16  # entries a site; 22.5 deg apart turn the rim of the contact by about as much as sites are apart
_MOST_SURPLUS = 12.0  # times as many sites are tried as are wanted; where that is too few, the mesh is at fault
_PIECE = 4096  # poses
_NORMAL_SCALE = 0.01  # m: two normals 1 rad apart count as far apart as two points 10 mm apart (the paper's alpha)


def codebook_poses(
    mesh: ObjectMesh,
    size: int,
    sensor: SensorModel,
    rng: np.random.Generator,
    pause: Callable[[], None] = lambda: None,
) -> np.ndarray:
    """Exactly `size` reachable gel poses T_obj_gel (size, 4, 4) (paper section 4.2, "evenly sample").

    Sites are a farthest-point sequence over (point, normal), so the sides of a thin plate count as apart and edges,
    where the normal turns, get more of them; and so the first of them, however many, cover the surface evenly, too.
    `pause` is called now and then; what it raises ends the work. Raises InputError if the object has hardly a reachable
    pose.
    """
    if size < 1:
        raise InputError(f"codebook size {size}; it needs at least 1 pose, 50000 is usual")
    yaws = min(YAWS, size)
    wanted = -(-size // yaws)
    reachability = Reachability(mesh, sensor)
    surplus, share = 2.0, 1.0
    while surplus <= _MOST_SURPLUS:
        points, normals = _candidates(mesh, max(round(6 * surplus * wanted), 512), rng)
        features = np.hstack([points, _NORMAL_SCALE * normals])
        sites = kernels.farthest_points(features, round(surplus * wanted))
        n = len(sites)
        yaw = (rng.random((n, 1)) + np.arange(yaws)) * (2 * np.pi / yaws)
        poses = pose_from_contact(
            np.repeat(points[sites], yaws, axis=0), np.repeat(normals[sites], yaws, axis=0),
            yaw.reshape(-1), np.zeros(n * yaws), np.zeros(n * yaws), np.full(n * yaws, PRESS),
        )  # fmt: skip
        reachable = _reachable(reachability, poses, size, pause)
        if len(reachable) == size:
            return reachable
        share = len(reachable) / len(poses)
        # as many as this share asks for, and some more
        surplus = 1.2 * max(surplus, 1 / max(share, 1e-3))
    raise InputError(f"{mesh.name}: only {share:.0%} of its surface can be reached; is it inside out?")


def _reachable(reachability: Reachability, poses: np.ndarray, size: int, pause: Callable[[], None]) -> np.ndarray:
    """The first `size` of the poses (N, 4, 4) that can be reached, settled, or fewer. In pieces: each is rendered."""
    found, count = [], 0
    for start in range(0, len(poses), _PIECE):
        pause()
        piece = poses[start : start + _PIECE]
        settled, reachable = reachability.settle(piece, np.full(len(piece), PRESS))
        found.append(settled[reachable])
        count += len(found[-1])
        if count >= size:
            break
    return np.concatenate(found)[:size]


def _candidates(mesh: ObjectMesh, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Surface points with face, edge and smoothed normals: near an edge a finger can lie at any of them."""
    points, normals = touch_points(mesh, n, edge_share=0.25, rng=rng)
    smooth = rng.random(n) < 0.4
    normals[smooth] = mesh.smooth_normals(points[smooth])
    return points, normals
