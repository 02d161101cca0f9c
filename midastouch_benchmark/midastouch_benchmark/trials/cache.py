"""Slides, codebooks, touches and symmetries of an accuracy run: made when first asked for, then kept in a folder."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.files import atomic_path, readable, sha256
from midastouch_common.mesh import ObjectMesh
from midastouch_common.output_paths import cached_codebook_path
from midastouch_filter.core.object_model import symmetry_of
from midastouch_filter.core.touch import Measurement, measurement_of
from midastouch_perception.codebook import Codebook
from midastouch_perception.symmetry.search import ObjectSymmetry
from midastouch_simulation.slide import STEP, Leap
from midastouch_tools.codebooks import cached_codebook
from midastouch_tools.datasets import Sequence, load_sequence
from midastouch_tools.datasets.slide_simulation import simulate_sequence

from .setup import Networks, untouched_of
from .trial import FRAME_TIME, TrialFrame

_WARM_UP_FRAMES = 3
_STAGES = ("tdn", "tcn")


@dataclass(frozen=True)
class Touches:
    """Touches of N frames. measurements: inputs of the filter, None for frames that are lost; ms: (N, 2), time of depth
    and code network."""

    measurements: list[Measurement | None]
    ms: np.ndarray

    @classmethod
    def perceive(cls, sequence: Sequence, networks: Networks) -> Touches:
        """Run the networks over a sequence; each frame once, timed."""
        images = [sequence.image(i) for i in range(sequence.n_frames)]
        return cls.of_images(images, untouched_of(sequence).image, networks)

    @classmethod
    def of_images(cls, images: Iterable[np.ndarray | None], background: np.ndarray, networks: Networks) -> Touches:
        """Run the networks over images, None if lost, and a no-contact image, all (320, 240, 3) uint8."""
        images, pipeline = list(images), networks.pipeline()
        for image in [each for each in images if each is not None][:_WARM_UP_FRAMES]:
            pipeline.process(image, background)
        pipeline = networks.pipeline()
        measurements: list[Measurement | None] = []
        ms = np.zeros((len(images), len(_STAGES)))
        for image, row in zip(images, ms, strict=True):
            if image is None:
                measurements.append(None)
                continue
            measurements.append(measurement_of(pipeline.process(image, background)))
            row[:] = [pipeline.ms.get(stage, 0.0) for stage in _STAGES]
        return cls(measurements, ms)

    def save(self, path: Path, made_from: dict) -> None:
        """Write one `.npz`; made_from: all that the touches depend on, of which `tcn` is the id of the code network."""
        all_of = [Measurement(False) if m is None else m for m in self.measurements]
        content = {
            "lost": np.array([m is None for m in self.measurements]),
            "in_contact": np.array([m.in_contact for m in all_of]),
            "area": np.array([m.contact_area for m in all_of]),
            "code": np.array([m.code for m in all_of if m.in_contact], np.float32),
            "relief": np.array([m.penetration for m in all_of if m.in_contact], np.float32),
            "ms": self.ms,
            "made_from": np.array(json.dumps(made_from)),
        }
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(stream, **content)  # type: ignore[arg-type] # none has the name of an option

    @classmethod
    def load(cls, path: Path) -> tuple[Touches, dict]:
        """Return the touches in a file of `save`, and all that they depend on; InputError for any other file."""
        with readable(path, "not a file of touches", "remove it"):
            with np.load(path, allow_pickle=False) as data:
                made_from = json.loads(str(data["made_from"]))
                lost, in_contact, area, ms = data["lost"], data["in_contact"], data["area"], data["ms"]
                touching = iter(zip(data["code"], area[in_contact], data["relief"], strict=True))
            measurements: list[Measurement | None] = []
            for gone, touched in zip(lost, in_contact, strict=True):
                if touched:
                    code, a, penetration = next(touching)
                    measurements.append(Measurement(True, code, float(a), made_from["tcn"], penetration))
                else:
                    measurements.append(None if gone else Measurement(False))
        return cls(measurements, ms), made_from

    def frames(self, sequence: Sequence, stride: int) -> list[TrialFrame]:
        """Return the frames of a trial over the sequence, every `stride`-th that is not lost."""
        out, before = [], -stride
        for i in range(0, sequence.n_frames, stride):
            if (measurement := self.measurements[i]) is None:
                continue
            ms, seconds = dict(zip(_STAGES, self.ms[i].tolist(), strict=True)), FRAME_TIME * (i - before)
            poses = sequence.poses_measured[i], sequence.poses_true[i]
            out.append(TrialFrame(i, measurement, ms, *poses, seconds))
            before = i
        return out


_SEEDS = 10  # tried for a slide that gets stuck
_NEXT_SEED = 1000
LIGHT = "additive"  # of the slides: TACTO's


@dataclass(frozen=True)
class SlideKind:
    """Kind of slides. length [m]; leap: on the way; grasp: name of what is done in place of a slide; first [m]: part
    that is followed (None: all), so that protocols that need less share the slides of those that need more."""

    length: float = 0.5
    leap: Leap | None = None
    grasp: str = ""
    first: float | None = None

    @property
    def followed(self) -> float:
        """Length [m] that a trial follows."""
        return self.first or self.length

    def of_length(self, length: float | None) -> SlideKind:
        """Return the same kind with another length [m], all of it followed; for None, the kind itself."""
        return dataclasses.replace(self, length=length, first=None) if length else self

    @property
    def name(self) -> str:
        """Name for keys."""
        return f"{1e3 * self.first:.0f}mm_of_{self.folder}" if self.first else self.folder

    @property
    def folder(self) -> str:
        """Name for folders, the same for slides that are made alike."""
        if self.grasp:
            return self.grasp
        parts = [f"{1e3 * self.length:.0f}mm"]
        if self.leap is not None:
            parts.append(f"leap{1e3 * self.leap.distance:.0f}mm")
            parts += [f"{np.degrees(self.leap.angle):.0f}deg"] if self.leap.angle is not None else []
        return "_".join(parts)


@dataclass(frozen=True)
class Cache:
    """Inputs of trials: slides, codebooks, touches and symmetries.

    folder: where they are kept, apart for each sensor model; tdn, tcn, sensor: as for `Networks.load`; slides: their
    kind; codebook_size: poses.
    """

    folder: Path
    tdn: str = "fast"
    tcn: str = "fast"
    sensor: str = "digit_tacto"
    slides: SlideKind = SlideKind()
    codebook_size: int = 50_000
    PREFIX: ClassVar[str] = ""  # of folders of slides that are not over the mesh asked for

    def __getstate__(self) -> dict:
        """Return the state without the networks: another process loads its own."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def networks(self) -> Networks:
        """Networks for the light of the slides, which is TACTO's; loaded on first use."""
        return Networks.load(self.tdn, self.tcn, self.sensor, LIGHT)

    def describe(self) -> dict[str, str]:
        """Return all that the touches of every slide depend on, for the JSON."""
        return self.networks.describe()

    def codebook(self, mesh: ObjectMesh, size: int | None = None) -> Codebook:
        """Return the object's codebook, of `size` poses if given, or of `codebook_size`."""
        networks = self.networks
        return cached_codebook(
            mesh, networks.tcn, networks.sensor, size or self.codebook_size, self._home / "codebooks", jobs=1
        )

    def codebook_digest(self, mesh: ObjectMesh, size: int | None = None) -> str:
        """Return a hash of the same codebook, which must have been made."""
        return sha256(self.codebook_path(mesh, size))[:12]

    def codebook_path(self, mesh: ObjectMesh, size: int | None = None) -> Path:
        """Return the path at which `codebook` keeps it."""
        return cached_codebook_path(mesh.name, size or self.codebook_size, self._home / "codebooks")

    @property
    def _touches(self) -> str:
        return "touches"

    @property
    def _home(self) -> Path:
        return self.folder / Path(self.sensor).stem

    def slide(self, mesh: ObjectMesh, number: int) -> Sequence:
        """Return slide `number` over the object. The number is its seed; if that gets stuck, 1000 is added to it."""
        kind = f"{self.PREFIX}{self.slides.folder}_{mesh.sha256[:8]}"
        path = self._home / "slides" / kind / mesh.name / f"{number:02d}"
        if not path.is_dir():
            self._simulate(mesh, number, path)
        return load_sequence(path)

    def _simulate(self, mesh: ObjectMesh, number: int, path: Path) -> None:
        # caches with networks for other light share the slides, of which they use the paths only
        kind, sensor = self.slides, dataclasses.replace(self.networks.sensor, light=LIGHT)
        for attempt in range(_SEEDS):
            seed = number + _NEXT_SEED * attempt
            try:
                simulate_sequence(mesh, sensor, kind.length, seed, path, True, leap=kind.leap)
                return
            except InputError as error:
                stuck = error
        raise InputError(f"{mesh.name}: no slide of {kind.length} m in {_SEEDS} tries ({stuck}); give a shorter one")

    def touches(self, mesh: ObjectMesh, number: int) -> tuple[Sequence, Touches]:
        """Return slide `number` over the object and its touches, as the networks measure them."""
        sequence = self.slide(mesh, number)
        made_from = {"sequence": str(sequence.path.name), "frames": sequence.n_frames, **self.describe()}
        path = self._home / self._touches / sequence.path.parent.parent.name / f"{mesh.name}_{number:02d}.npz"
        try:
            touches, kept_from = Touches.load(path)
            if made_from.items() <= kept_from.items():
                return sequence, touches
        except InputError:  # none yet, or damaged
            pass
        touches = self._perceive(mesh, sequence, number)
        touches.save(path, made_from)
        return sequence, touches

    def frames(self, mesh: ObjectMesh, number: int, stride: int = 1) -> list[TrialFrame]:
        """Return every `stride`-th frame of slide `number` over the object, as a trial takes them."""
        sequence, touches = self.touches(mesh, number)
        frames, first = touches.frames(sequence, stride), self.slides.first
        return frames if first is None else [frame for frame in frames if frame.index < round(first / STEP)]

    def _perceive(self, mesh: ObjectMesh, sequence: Sequence, number: int) -> Touches:
        return Touches.perceive(sequence, self.networks)

    def symmetry(self, mesh: ObjectMesh) -> ObjectSymmetry:
        """Return the object's symmetry."""
        return symmetry_of(mesh, self.codebook(mesh))
