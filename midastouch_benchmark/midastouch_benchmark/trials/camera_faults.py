"""Slides seen by a real sensor whose images, or their stamps, have a fault, for protocol `camera_faults`.

Sixteen faults of cameras, cables, lamps and gels take turns. What the node `tdn` refuses, and what a camera loses, is
no frame of the trial; the arm moves on meanwhile.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import cv2
import numpy as np

from midastouch_common.mesh import ObjectMesh
from midastouch_perception.tdn.fixed_pattern import PatternCheck
from midastouch_perception.tdn.frame_guard import FrameGuard
from midastouch_tools.datasets import Sequence

from .cache import Touches
from .disturbances import delayed
from .real_sensor import RealSensorCache
from .trial import FRAME_TIME, TrialFrame

Images = list[np.ndarray | None]
"""Images (H, W, 3) uint8 RGB of a slide, the no-contact image first; None is a frame that never comes."""
Fault = Callable[[list[np.ndarray], np.random.Generator], Images]

_NOISE, _BLUR = 8.0, 2.5  # grey levels, px: sigma
_DEAD_ROWS = 3
_JUMP, _HOLDS = 0.3, 20  # largest relative step of the exposure, frames between steps
_FLICKER, _BAND, _BEAT = 0.08, 90.0, 5.3  # relative; rows, frames of one period
_TORN, _DROPPED = 0.1, 0.3  # of the frames
_GAP, _FROZEN = 20, 40  # frames, 1 s and 2 s
_ROLL = 80  # px
_JITTER = 0.05  # s
_SPECKS, _SCRATCHES = 12, 5
_WORN = 0.5  # of the light's change that is left
_DRIFT = 0.15  # relative, largest at the end
_DOTS, _DOT, _DARK = 24, 3, 0.4  # px between markers, their radius, brightness


def _each(change: Callable[[np.ndarray, int, np.random.Generator], np.ndarray], gel: bool = False) -> Fault:
    """Return a fault that changes each image (H, W, 3) float by its number; gel: the no-contact image, too."""

    def fault(images: list[np.ndarray], rng: np.random.Generator) -> Images:
        changed = [change(image.astype(np.float32), k, rng) for k, image in enumerate(images)]
        out = [np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in changed]
        return [*out] if gel else [images[0], *out[1:]]

    return fault


def _covered(draw: Callable[[np.ndarray, np.random.Generator], None], from_start: bool = False) -> Fault:
    """Return a fault that darkens what `draw` sets in a mask (H, W) of ones, in the second half of the slide."""

    def fault(images: list[np.ndarray], rng: np.random.Generator) -> Images:
        mask = np.ones(images[0].shape[:2], np.float32)
        draw(mask, rng)
        first = 1 if from_start else len(images) // 2
        return [*images[:first], *((image * mask[..., None]).clip(0, 255).astype(np.uint8) for image in images[first:])]

    return fault


def _noise(image: np.ndarray, k: int, rng: np.random.Generator) -> np.ndarray:
    return image + _NOISE * rng.standard_normal(image.shape, np.float32)


def _dead_rows(mask: np.ndarray, rng: np.random.Generator) -> None:
    mask[rng.choice(len(mask), _DEAD_ROWS, replace=False)] = 0


def _exposure(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    factors = rng.uniform(1 - _JUMP, 1 + _JUMP, len(images) // _HOLDS + 1)
    lit = _each(lambda image, k, _: image * factors[k // _HOLDS])
    return lit(images, rng)


def _flicker(image: np.ndarray, k: int, rng: np.random.Generator) -> np.ndarray:
    phase = np.arange(len(image)) / _BAND + k / _BEAT
    return image * (1 + _FLICKER * np.sin(2 * np.pi * phase))[:, None, None].astype(np.float32)


def _blur(image: np.ndarray, k: int, rng: np.random.Generator) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), _BLUR)


def _torn(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    out = list(images)
    for k in 1 + np.flatnonzero(rng.random(len(images) - 2) < _TORN):
        row = rng.integers(4, len(images[k]) - 3)
        out[k] = np.concatenate([images[k][:row], images[k + 1][row:]])
    return [*out]


def _rolled(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    half = len(images) // 2
    return [*images[:half], *(np.roll(image, _ROLL, axis=1) for image in images[half:])]


def _frozen(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    half = len(images) // 2
    return [*images[:half], *[images[half - 1]] * _FROZEN, *images[half + _FROZEN :]]


def _dropped(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    lost, half = rng.random(len(images)) < _DROPPED, len(images) // 2
    lost[half : half + _GAP], lost[:2] = True, False
    return [None if gone else image for gone, image in zip(lost, images, strict=True)]


def _duplicated(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    return [images[0], *(images[k - (k - 1) % 3] for k in range(1, len(images)))]


def _dirt(mask: np.ndarray, rng: np.random.Generator) -> None:
    for _ in range(_SPECKS):
        centre, radius = rng.integers([mask.shape[1], mask.shape[0]]).tolist(), int(rng.integers(3, 9))
        cv2.circle(mask, centre, radius, rng.uniform(0.3, 0.8), cv2.FILLED)


def _scratched(mask: np.ndarray, rng: np.random.Generator) -> None:
    for _ in range(_SCRATCHES):
        ends = rng.integers([mask.shape[1], mask.shape[0]], size=(2, 2)).tolist()
        cv2.line(mask, ends[0], ends[1], rng.uniform(0.6, 1.4), 2)


def _worn(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    free = images[0].astype(np.float32)
    return _each(lambda image, k, _: free + _WORN * (image - free))(images, rng)


def _drift(images: list[np.ndarray], rng: np.random.Generator) -> Images:
    ends = rng.uniform(-_DRIFT, _DRIFT, 3).astype(np.float32)
    return _each(lambda image, k, _: image * (1 + ends * k / len(images)))(images, rng)


def _markers(image: np.ndarray, k: int, rng: np.random.Generator) -> np.ndarray:
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]] % _DOTS - _DOTS // 2
    return image * np.where(rows**2 + columns**2 <= _DOT**2, _DARK, 1.0).astype(np.float32)[..., None]


JITTER = "stamps off by up to 50 ms"
FAULTS: dict[str, Fault] = {
    "noise of 8 grey levels": _each(_noise),
    "three rows die": _covered(_dead_rows),
    "exposure jumps by up to 30 %": _exposure,
    "lamps flicker by 8 %": _each(_flicker),
    "out of focus": _each(_blur, gel=True),
    "a tenth of the frames is torn": _torn,
    "the image rolls by 80 px": _rolled,
    "the camera hangs for 2 s": _frozen,
    JITTER: lambda images, rng: [*images],
    "a third of the frames is lost, and 1 s": _dropped,
    "every image comes three times": _duplicated,
    "dirt falls on the gel": _covered(_dirt),
    "scratches since the no-contact image": _covered(_scratched, from_start=True),
    "worn gel shows half": _worn,
    "lamps drift by up to 15 %": _drift,
    "markers on the gel": _each(_markers, gel=True),
}
"""Faults by description; slides take them in turn."""


@dataclasses.dataclass(frozen=True)
class CameraFaultCache(RealSensorCache):
    """A cache whose slides, of calibrated measured sensors, have the faults in turn, each on the same paths."""

    calibrated: bool = True

    @property
    def _touches(self) -> str:
        return "touches_with_faults"

    def slide(self, mesh: ObjectMesh, number: int) -> Sequence:
        """Return the path of slide `number`: consecutive numbers share one, each with another fault."""
        return super().slide(mesh, number // len(FAULTS))

    def frames(self, mesh: ObjectMesh, number: int, stride: int = 1) -> list[TrialFrame]:
        """Return every `stride`-th frame that is left of slide `number`."""
        frames = super().frames(mesh, number, stride)
        if _fault(number) != JITTER:
            return frames
        off = np.random.default_rng(number).uniform(-_JITTER, _JITTER, len(frames)) / (stride * FRAME_TIME)
        return delayed(frames, off)

    def _perceive(self, mesh: ObjectMesh, sequence: Sequence, number: int) -> Touches:
        images, background, networks = self._seen(mesh, sequence, number // len(FAULTS))
        rng = np.random.default_rng(number)
        background, *seen = FAULTS[_fault(number)]([_full_size(each, rng) for each in (background, *images)], rng)
        return Touches.of_images(_guarded(seen, background), background, networks)


def _fault(number: int) -> str:
    return list(FAULTS)[number % len(FAULTS)]


def _full_size(image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return an image of a measured sensor, whose pixels are equal in fours, with the lines and noise of a camera."""
    smooth = cv2.resize(image[::2, ::2].astype(np.float32), image.shape[1::-1])
    return np.clip(np.rint(smooth + rng.standard_normal(image.shape, np.float32)), 0, 255).astype(np.uint8)


def _guarded(images: Images, background: np.ndarray) -> Images:
    """Return the images with None for those that the node `tdn` would refuse, too."""
    guard, pattern = FrameGuard(), PatternCheck()
    return [
        None if image is None or guard.refusal(image) or pattern.refusal(image, background) else image
        for image in images
    ]
