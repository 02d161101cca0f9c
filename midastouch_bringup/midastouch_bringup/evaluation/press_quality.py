"""Presses of a ball on a real sensor: is what the depth network feels the cap of one sphere?

Nobody knows the true penetration of a real press. But the relief of a ball has one curvature in all directions, the
same in every press, bulges towards the camera, ends in a round outline, and leaves the rest of the gel alone.
Only the contact (penetration) is felt; the surface of the ball is the undeformed, domed gel raised by it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import trimesh

from midastouch_perception import se3
from midastouch_perception.errors import InputError
from midastouch_perception.mesh import ObjectMesh
from midastouch_perception.pipeline import DepthStage
from midastouch_perception.pointcloud import cloud_from_penetration
from midastouch_perception.sensor_model import SensorModel
from midastouch_perception.simulation.renderer import PenetrationRenderer
from midastouch_perception.tdn import DepthNet
from midastouch_perception.tdn.fit_check import explained_share

from ..datasets.sequence import read_image
from .depth_quality import CONTACT_THRESHOLD
from .sphere_fit import fit_sphere, principal_curvatures

BACKGROUND = "background.png"
_VISIBLE = 15.0  # grey levels: a change the eye sees too
_HALO = 0.5e-3  # m around what is visible
_CORE = 0.5  # of the deepest penetration: the rim is smeared by the gel, which cannot follow it
_FEWEST = 40  # px a core needs for a fit


def load_presses(folder: str | Path) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Images (320, 240, 3) uint8 RGB of the presses by file name, repeated ones once, and the no-contact image.

    Raises InputError for a folder without `background.png` or without presses, and for unreadable images.
    """
    folder = Path(folder)
    if not (folder / BACKGROUND).is_file():
        raise InputError(f"{folder}: no {BACKGROUND} in it; name a folder of presses with their no-contact image")
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in (".png", ".jpg") and p.name != BACKGROUND)
    presses, seen = {}, set()
    for path in paths:
        image = read_image(path)
        if image.tobytes() not in seen:
            seen.add(image.tobytes())
            presses[path.name] = image
    if not presses:
        raise InputError(f"{folder}: no presses (PNG or JPEG) beside {BACKGROUND}")
    return presses, read_image(folder / BACKGROUND)


def visible_contact(difference: np.ndarray, sensor: SensorModel) -> np.ndarray:
    """Where (H, W) bool a difference image (H, W, 3), grey levels, shows a contact or its shadow.

    The largest connected region of visible change and what is within half a millimetre of it.
    """
    change = np.abs(cv2.GaussianBlur(difference, (0, 0), 1.5)).max(axis=2) > _VISIBLE
    region = _largest_region(change)
    reach = round(_HALO * sensor.focal / sensor.gel_distance)
    return cv2.dilate(region.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=reach) > 0


def measure_presses(
    tdn: DepthNet,
    presses: dict[str, np.ndarray],
    background: np.ndarray,
    progress: Callable[[int], object] = lambda presses: None,
) -> tuple[list[dict], dict]:
    """Figures of every press and their summary: the `presses` and `summary` of the `evaluate-presses` JSON."""
    rows, cores, maps = [], [], []
    for name, image in presses.items():
        difference = tdn.difference(image, background)
        penetration = DepthStage(tdn).process(image, background).penetration
        row, core = _describe(difference, penetration, tdn.sensor)
        rows.append({"image": name, **row})
        cores.append(core)
        maps.append(penetration)
        progress(1)
    radii = [row["radius_mm"] for row in rows if row["radius_mm"] is not None]
    radius = float(np.median(radii)) * 1e-3 if radii else None
    if radius:
        renderer = ball_renderer(radius, tdn.sensor)
        for row, core, penetration in zip(rows, cores, maps, strict=True):
            if core is not None:
                row |= _against_ball(fit_sphere(core, radius).centre, renderer, penetration)
    return rows, _summary(rows, radius)


def ball_renderer(radius: float, sensor: SensorModel) -> PenetrationRenderer:
    """Renders a ball of `radius` m about the origin; `render_ball` places it."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    return PenetrationRenderer(ObjectMesh.from_arrays(ball.vertices, ball.faces, "ball"), sensor)


def render_ball(renderer: PenetrationRenderer, centre: np.ndarray) -> np.ndarray:
    """Penetration (H, W) m of the ball with its centre (3,) m in the gel frame."""
    return renderer.render(se3.make(np.eye(3), -np.asarray(centre, float))[None])[0]


def _describe(difference: np.ndarray, penetration: np.ndarray, sensor: SensorModel) -> tuple[dict, np.ndarray | None]:
    """Figures of one press, and the points (N, 3) m of the contact's core if it is worth a fit."""
    visible = visible_contact(difference, sensor)
    total = float(penetration.sum())
    contact = _largest_region((penetration >= CONTACT_THRESHOLD) & visible)
    row = {
        "found": bool(contact.any()),
        "deepest_mm": 1e3 * float(penetration.max()),
        "area_mm2": 1e6 * float(contact.sum()) * sensor.pixel_area,
        "roundness": _roundness(contact),
        "outside_share": float(penetration[~visible].sum()) / total if total else 0.0,
        "explained_share": explained_share(difference, penetration),
        "radius_mm": None,
        "residual_mm": None,
        "curvature_ratio": None,
        "bulges": False,
    }
    inside = np.where(contact, penetration, 0)
    core = _largest_region(inside > _CORE * inside.max()) if contact.any() else contact
    if core.sum() < _FEWEST:
        return row, None
    points = cloud_from_penetration(penetration, core, sensor).astype(float)
    low, high = principal_curvatures(points)
    row["bulges"] = bool(low > 0)
    if not row["bulges"]:
        return row, None
    sphere = fit_sphere(points)
    row |= {
        "radius_mm": 1e3 * sphere.radius,
        "residual_mm": 1e3 * sphere.residual,
        "curvature_ratio": float(low / high),
    }
    return row, points


def _against_ball(centre: np.ndarray, renderer: PenetrationRenderer, penetration: np.ndarray) -> dict:
    rendered = render_ball(renderer, centre)
    felt, there = penetration >= CONTACT_THRESHOLD, rendered >= CONTACT_THRESHOLD
    return {
        "ball_centre_mm": (1e3 * centre).tolist(),
        "ball_iou": float((felt & there).sum() / max((felt | there).sum(), 1)),
        "ball_rmse_mm": 1e3 * float(np.sqrt(np.mean((penetration - rendered) ** 2))),
    }


def _summary(rows: list[dict], radius: float | None) -> dict:
    """Shares over all presses, medians over those that have the figure, spread of the radius."""

    def median(key: str) -> float:
        values = [row[key] for row in rows if row.get(key) is not None]
        return float(np.median(values)) if values else float("nan")

    radii = np.array([row["radius_mm"] for row in rows if row["radius_mm"] is not None])
    return {
        "presses": len(rows),
        "found_share": float(np.mean([row["found"] for row in rows])),
        "bulges_share": float(np.mean([row["bulges"] for row in rows])),
        "radius_mm": 1e3 * radius if radius else None,
        "radius_spread": float(radii.std() / radii.mean()) if len(radii) else float("nan"),
        **{
            key: median(key)
            for key in (
                "residual_mm",
                "curvature_ratio",
                "roundness",
                "outside_share",
                "explained_share",
                "deepest_mm",
                "area_mm2",
                "ball_iou",
                "ball_rmse_mm",
            )
        },
    }


def _roundness(mask: np.ndarray) -> float:
    """Area over that of the smallest circle around it: 1 for a disc, 0 for nothing."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return 0.0
    _, radius = cv2.minEnclosingCircle(np.column_stack([columns, rows]).astype(np.float32))
    # the circle goes through pixel centres, the area counts whole pixels
    return float(min(1.0, len(rows) / (np.pi * (radius + 0.5) ** 2)))


def _largest_region(mask: np.ndarray) -> np.ndarray:
    """The largest connected region (H, W) bool of a mask, empty if it is."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if len(stats) < 2:
        return np.zeros(mask.shape, bool)
    return labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
