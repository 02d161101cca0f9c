"""Measurement of one finger in one frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

import midastouch_kernels as kernels
from midastouch_common.errors import InputError

if TYPE_CHECKING:
    from midastouch_perception.pipeline import TouchReading

MAP_SCALE = 0.25
"""Size, relative to the camera image, of the maps that the filter compares with rendered ones: 80 x 60 pixels."""


@dataclass(frozen=True)
class Measurement:
    """One touch of one finger, or its absence.

    Attributes
    ----------
    in_contact
        True if the gel touches something.
    code : tactile code (D,), or None
    contact_area : touched area [m^2]
    network_id
        Network of the code, "" if unknown.
    penetration : measured map (80, 60) float32 [m], reduced by `reduced_penetration`, or None
    T_gel_finger
        Pose (4, 4) of the gel that measured it, in the gel frame of the first finger, whose pose the filter estimates;
        None for the first finger itself. If the two images were taken at different times, each gel is where it was at
        the time of its image, in the frame that the object rests in.
    """

    in_contact: bool
    code: np.ndarray | None = None
    contact_area: float = 0.0
    network_id: str = ""
    penetration: np.ndarray | None = None
    T_gel_finger: np.ndarray | None = None


def gels_of(touches: Sequence[Measurement]) -> np.ndarray:
    """Return the poses (F, 4, 4) of the gels that touch, in the frame of the first finger's gel."""
    gels = [np.eye(4) if touch.T_gel_finger is None else touch.T_gel_finger for touch in touches]
    return np.array(gels).reshape(-1, 4, 4)


def require_network(touches: Iterable[Measurement], network_id: str) -> None:
    """Raise InputError if a code comes from another network than that of the codebook, "" if that is unknown."""
    for theirs in (touch.network_id for touch in touches):
        if theirs and network_id and theirs != network_id:
            raise InputError(
                f"tactile code: from network {theirs}, but the codebook was built with {network_id};"
                " build the codebook with the encoder in use"
            )


def reduced_penetration(penetration: np.ndarray) -> np.ndarray:
    """Reduce a penetration map by block means.

    Parameters
    ----------
    penetration : map [m] whose sides are multiples of 80 and 60

    Returns
    -------
    (80, 60) float32
        Map [m] for `Measurement`.
    """
    rows, columns = penetration.shape[0] // 80, penetration.shape[1] // 60
    return kernels.block_means(np.ascontiguousarray(penetration, np.float32), rows, columns)


def measurement_of(touch: TouchReading) -> Measurement:
    """Return the measurement of one touch, with its penetration map.

    Parameters
    ----------
    touch
    """
    contact = touch.contact
    penetration = reduced_penetration(contact.penetration) if contact.in_contact else None
    return Measurement(contact.in_contact, touch.code, contact.area_m2, touch.network_id, penetration)


def measurement_from_msg(msg: Any) -> Measurement:
    """Return the measurement of a TactileCode message, without a map; its code is a read-only view of the message."""
    code = np.frombuffer(msg.code, np.float32) if msg.in_contact else None
    return Measurement(msg.in_contact, code, msg.contact_area, msg.network_id)
