"""What the networks make of a slide, computed once and kept: every trial on the slide starts from it."""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from midastouch_bringup.datasets import Sequence
from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path
from midastouch_filter.core.touch import Measurement, measurement_of

from .setup import Networks, untouched_of
from .trial import FRAME_TIME, TrialFrame

_WARM_UP_FRAMES = 3
_STAGES = ("tdn", "tcn")


@dataclass(frozen=True)
class Touches:
    """Of N frames: felt, what the filter is told; ms (N, 2), time of depth and code network; made_from, what they
    depend on."""

    felt: list[Measurement]
    ms: np.ndarray
    made_from: dict

    @classmethod
    def perceive(cls, sequence: Sequence, networks: Networks) -> Touches:
        """Run the networks over a sequence; each frame once, timed."""
        free = untouched_of(sequence)
        images = [sequence.image(i) for i in range(sequence.n_frames)]
        return cls.of_images(images, free.image, networks, made_from(sequence, networks) | {"background": free.source})

    @classmethod
    def of_images(cls, images: list[np.ndarray], background: np.ndarray, networks: Networks, origin: dict) -> Touches:
        """Run the networks over images and a no-contact image, all (320, 240, 3) uint8; origin: as `made_from`."""
        pipeline = networks.pipeline()
        for image in images[:_WARM_UP_FRAMES]:
            pipeline.process(image, background)
        pipeline = networks.pipeline()
        felt, ms = [], np.zeros((len(images), len(_STAGES)))
        for image, row in zip(images, ms, strict=True):
            felt.append(measurement_of(pipeline.process(image, background)))
            row[:] = [pipeline.ms.get(stage, 0.0) for stage in _STAGES]
        return cls(felt, ms, origin)

    def save(self, path: Path) -> None:
        """Write one `.npz`."""
        code = np.array([m.code for m in self.felt if m.in_contact], np.float32)
        relief = np.array([m.penetration for m in self.felt if m.in_contact], np.float32)
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(
                stream,
                in_contact=np.array([m.in_contact for m in self.felt]),
                area=np.array([m.contact_area for m in self.felt]),
                code=code,
                relief=relief,
                ms=self.ms,
                made_from=np.array(json.dumps(self.made_from)),
            )

    @classmethod
    def load(cls, path: Path) -> Touches:
        """Read what `save` wrote; InputError for anything else."""
        try:
            with np.load(path, allow_pickle=False) as data:
                origin = json.loads(str(data["made_from"]))
                in_contact, area, ms = data["in_contact"], data["area"], data["ms"]
                felt = iter(zip(data["code"], area[in_contact], data["relief"], strict=True))
            measurements = []
            for touching in in_contact:
                if touching:
                    code, a, relief = next(felt)
                    measurements.append(Measurement(True, code, float(a), origin["tcn"], relief))
                else:
                    measurements.append(Measurement(False))
        except (OSError, ValueError, KeyError, EOFError, StopIteration, zipfile.BadZipFile) as error:
            raise InputError(f"{path}: not a file of touches ({error}); remove it") from error
        return cls(measurements, ms, origin)

    def frames(self, sequence: Sequence, stride: int) -> list[TrialFrame]:
        """Frames of a trial over the sequence, every `stride`-th."""
        return [
            TrialFrame(
                i,
                self.felt[i],
                dict(zip(_STAGES, self.ms[i].tolist(), strict=True)),
                sequence.poses_measured[i],
                sequence.poses_true[i],
                FRAME_TIME * stride,
            )
            for i in range(0, sequence.n_frames, stride)
        ]


def made_from(sequence: Sequence, networks: Networks) -> dict:
    """What the touches of a sequence depend on."""
    return {"sequence": str(sequence.path.name), "frames": sequence.n_frames, **networks.describe()}
