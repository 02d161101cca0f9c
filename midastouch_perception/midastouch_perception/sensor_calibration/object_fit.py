"""The calibration of a sensor without a ball: from a slide over an object whose shape and poses are known."""

from __future__ import annotations

import dataclasses

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh

from ..rendering.renderer import PenetrationRenderer
from ..sensor_model import SensorModel
from ..tdn.inputs import ContactLight, check_image, reduce_image, without_drift
from .fit import FEWEST, Result, cross_validation, fitted, made_of, require_upright
from .network_checks import depth_errors
from .presses import Press, reasons, sensor_mismatch
from .refine import refine_poses

_MOST_TOUCHES = 40  # of a slide: more add little
_LEAST_PENETRATION = 0.2e-3  # m: less leaves hardly a trace
_LEAST_FREE = 0.4  # of the image: elsewhere it must be seen how bright the frame is
_LEAST_EXPLAINED = 0.3  # of a touch, by the light of all
_LEAST_AGREEMENT = 0.5  # fraction of the slopes that the fit explains on touches it has not seen
_LEAST_SLOPE = 0.1  # typical slope of a contact: less shows nothing of the colours


def choose_touches(poses: np.ndarray, mesh: ObjectMesh, sensor: SensorModel) -> list[int]:
    """Which of the poses T_obj_gel (N, 4, 4) of a slide to calibrate from: at most 40 contacts, spread over it.

    sensor: full size. Raises InputError if too few press a shape into the gel.
    """
    half = sensor.for_maps
    maps = PenetrationRenderer(mesh, half).render(poses)
    touched = maps > 0
    slopes = np.hypot(*np.gradient(maps, half.pixel_size, axis=(1, 2)))
    steep = (slopes * touched).sum(axis=(1, 2)) > _LEAST_SLOPE * touched.sum(axis=(1, 2))
    usable = np.flatnonzero(
        steep & (maps.max(axis=(1, 2)) > _LEAST_PENETRATION) & (touched.mean(axis=(1, 2)) < 1 - _LEAST_FREE)
    )
    if len(usable) < FEWEST:
        raise InputError(
            f"{len(usable)} of {len(poses)} poses press '{mesh.name}' into the gel so that its shape is seen, {FEWEST} "
            "are needed; check the mesh (metres), its frame and the poses, or slide over edges and bumps"
        )
    return np.unique(usable[np.linspace(0, len(usable) - 1, _MOST_TOUCHES).round().astype(int)]).tolist()


def calibrate_on_object(
    images: dict[str, np.ndarray],
    poses: np.ndarray,
    background: np.ndarray,
    mesh: ObjectMesh,
    sensor: SensorModel,
    serial: str = "",
) -> Result:
    """Calibrate from images (320, 240, 3) uint8 RGB by name of touches at poses T_obj_gel (N, 4, 4).

    Poses may be off as tracked ones are. background: no-contact image; sensor: full size. Raises InputError if the
    images do not allow it: too few usable touches, another object, other poses.
    """
    half = sensor.for_maps
    light = ContactLight(reduce_image(check_image(background, sensor, "background")), sensor.light)
    touches = []
    for name, image in images.items():
        seen = light.difference(reduce_image(check_image(image, sensor, name)))
        touches.append(Press(name, without_drift(seen), None, sensor_mismatch(image, seen)))
    touches, penetrations = _refined(touches, poses, PenetrationRenderer(mesh, half))
    usable = sum(not touch.problem for touch in touches)
    if usable < FEWEST:
        raise InputError(f"{usable} of {len(touches)} touches can be used, {FEWEST} are needed. {reasons(touches)}")
    changes = [touch.change for touch in touches]
    used = [(change, p) for change, p in zip(changes, penetrations, strict=True) if p is not None]
    require_upright(*zip(*used, strict=True), half)
    made = made_of(background, sensor, serial, object_name=mesh.name)
    calibration, held_out = fitted(changes, penetrations, half.pixel_size, made)
    figures = cross_validation(changes, penetrations, held_out, half.pixel_size)
    if figures["explained_after"] < _LEAST_AGREEMENT:
        raise InputError(
            f"the images do not agree with '{mesh.name}' at these poses (a calibration explains "
            f"{100 * figures['explained_after']:.0f} % of the slopes of touches it has not seen); check the mesh, its "
            "frame, the hand-eye calibration and the clocks of camera and arm (midastouch time-offset)"
        )
    figures |= depth_errors([images[touch.name] for touch in touches], penetrations, held_out, background, sensor)
    return Result(calibration, touches, penetrations, half, background, held_out, figures)


def _refined(
    touches: list[Press], poses: np.ndarray, renderer: PenetrationRenderer
) -> tuple[list[Press], list[np.ndarray | None]]:
    """The touches as judged at refined poses, and the penetration of those that are used."""
    used = [i for i, touch in enumerate(touches) if not touch.problem]
    if not used:
        return touches, [None] * len(touches)
    moved, fractions = refine_poses([touches[i].change for i in used], poses[used], renderer)
    judged, penetrations = list(touches), [None] * len(touches)
    for i, pose, fraction in zip(used, moved, fractions, strict=True):
        if fraction < _LEAST_EXPLAINED:
            why = f"not what the object leaves at this pose (explains {100 * fraction:.0f} % of it)"
            judged[i] = dataclasses.replace(touches[i], problem=why)
        else:
            penetrations[i] = renderer.render(pose[None])[0]
    return judged, penetrations
