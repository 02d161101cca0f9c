"""What is compared on the same slides: presets, a mechanism off, less work, other codebooks, other methods."""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from midastouch_bringup.inspection import require_open3d
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import PRESETS, preset_in_words
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.paper_filter import PaperConfig, PaperFilter
from midastouch_perception.codebook import Codebook

from ..baselines.registration import DeadReckoning, OdometryConfig, Registration, RegistrationConfig
from .trial import AnyFilter, TrialFrame


class ShortCodes:
    """Projects codes onto the `length` orthogonal directions that keep most of a codebook's codes, and normalises them.

    Principal components about the origin, not about the mean: of all projections they keep cosines best, in the mean
    of squares. Calibration of the score is left as it is.
    """

    def __init__(self, codes: np.ndarray, length: int):
        """`codes` (M, D) of the codebook; length at most D."""
        codes = np.asarray(codes, float)
        _, directions = np.linalg.eigh(codes.T @ codes)  # by rising share
        self._basis = directions[:, ::-1][:, :length]

    def shorten(self, codes: np.ndarray) -> np.ndarray:
        """Unit codes (..., length) float32 of codes (..., D)."""
        short = np.asarray(codes, float) @ self._basis
        short /= np.maximum(np.linalg.norm(short, axis=-1, keepdims=True), 1e-12)
        return short.astype(np.float32)

    def codebook(self, codebook: Codebook) -> Codebook:
        """The codebook with short codes."""
        return Codebook(codebook.poses, self.shorten(codebook.codes), codebook.meta)

    def frame(self, frame: TrialFrame) -> TrialFrame:
        """A frame with short codes."""
        others = {name: self._short(touch) for name, touch in frame.others.items()}
        return dataclasses.replace(frame, measurement=self._short(frame.measurement), others=others)

    def _short(self, touch: Measurement) -> Measurement:
        return touch if touch.code is None else dataclasses.replace(touch, code=self.shorten(touch.code))


DEFAULT, PRESET = "default", "preset"
PAPER, BASELINE, MECHANISM, GATE = "paper", "peer", "mechanism", "gate"
COUNT, INPUT, BUDGET, CONTACTS = "poses", "codebook", "budget", "contacts"
AnyConfig = FilterConfig | PaperConfig | OdometryConfig | RegistrationConfig
_CONFIGS = {"paper": PaperConfig, "odometry": OdometryConfig, "registration": RegistrationConfig}


@dataclasses.dataclass(frozen=True)
class Variant:
    """What differs from the default.

    summary, a line for tables; group, what kind of difference; method, if it is another than ours; settings, fields of
    `FilterConfig` or of the method's configuration; open_gates, names of the filter's gates that let everything pass;
    codebook_size, poses, and code_length, numbers per code, if they are not the plan's and the network's; contacts,
    number of fingers of a grasp whose touches are used, if not all.
    """

    summary: str
    group: str
    settings: dict[str, object] = dataclasses.field(default_factory=dict)
    open_gates: tuple[str, ...] = ()
    codebook_size: int | None = None
    code_length: int | None = None
    contacts: int | None = None
    method: str = ""

    @property
    def missing(self) -> str:
        """Why it cannot be run here; "" if it can."""
        if self.method == "registration":
            try:
                require_open3d()
            except InputError as error:
                return str(error)
        return ""

    def fingers(self, frame: TrialFrame) -> TrialFrame:
        """The frame with what its fingers feel; other methods than ours know the first one only."""
        count = 1 if self.method else self.contacts
        if count is None or len(frame.others) < count:
            return frame
        return dataclasses.replace(frame, others=dict(list(frame.others.items())[: count - 1]))

    @property
    def inputs(self) -> dict[str, object]:
        """What differs in addition to the settings, by name."""
        inputs = {name: getattr(self, name) for name in ("open_gates", "codebook_size", "code_length", "contacts")}
        return {name: value for name, value in inputs.items() if value}

    def describe(self) -> dict:
        """For the JSON: all but what is as in the default."""
        return {"summary": self.summary, "group": self.group} | self.settings | self.inputs

    def config(self, base: FilterConfig, threads: int) -> AnyConfig:
        """Settings of the filter: the variant's laid over `base`."""
        if self.method:
            return _CONFIGS[self.method](**self.settings)
        return dataclasses.replace(base, **({"threads": threads} | self.settings))

    def filter(self, mesh: ObjectMesh, codebook: Codebook, base: FilterConfig, threads: int) -> AnyFilter:
        """A filter of this variant, its stages timed."""
        config = self.config(base, threads)
        if self.method == "paper":
            return PaperFilter(mesh, codebook, config, clock=time.perf_counter, threads=threads)
        if self.method:
            method = {"odometry": DeadReckoning, "registration": Registration}[self.method]
            return method(mesh, codebook, config, clock=time.perf_counter)
        return ParticleFilter(mesh, codebook, config, clock=time.perf_counter, open_gates=self.open_gates)


def _each(group: str, setting: str, summary: str, values: dict[str, int]) -> dict[str, Variant]:
    """Variants by name that differ in one number, without the default's; summary, with a place for the number."""
    return {
        name: Variant(summary.format(value), group, {setting: value})
        for name, value in values.items()
        if value != getattr(FilterConfig, setting)
    }


_COUNTS = {"1k": 1_000, "5k": 5_000, "20k": 20_000, "50k": 50_000}
_TESTED = {f"test_{count}": count for count in (30, 100, 300, 1_000)}
_WORK = {f"work_{count}": count for count in (180, 600, 1_800, 6_000)}
_ALIGNED = {f"align_{count}": count for count in (1, 2, 4, 8)}


VARIANTS = {
    DEFAULT: Variant("as shipped", DEFAULT),
    **{
        name: Variant(f"preset {name}: {preset_in_words(name)}", PRESET, settings)
        for name, settings in PRESETS.items()
        if settings
    },
    "paper": Variant(
        "the paper's filter: softmax of cosines, resampling at every step, annealing, DBSCAN", PAPER, method="paper"
    ),
    "paper_5k": Variant("the same, started with 5,000 particles", PAPER, {"n_start": 5_000}, method="paper"),
    "registration": Variant("FPFH, RANSAC and ICP of the accumulated contact cloud", BASELINE, method="registration"),
    "odometry": Variant("the arm's odometry alone, from one draw of the start", BASELINE, method="odometry"),
    "no_refinement": Variant("codes only: nothing is compared with penetration maps", MECHANISM, {"refinement": False}),
    "no_drift": Variant(
        "the odometry is believed not to drift", MECHANISM, {"drift_translation": 0.0, "drift_rotation": 0.0}
    ),
    "no_lift": Variant("the object is believed to rest while the gel is lifted", MECHANISM, {"change_lifted": 0.0}),
    "no_push": Variant(
        "a push is believed to move nothing", MECHANISM, {"object_jump_translation": 1e-4, "object_jump_rotation": 1e-3}
    ),
    "no_tempering": Variant(
        "every touch counts in full, however near to the last", MECHANISM, {"correlation_length": 1e-5}
    ),
    "no_calibration": Variant("codes weighed as flatly as the paper's: temperature 1", MECHANISM, {"temperature": 1.0}),
    "no_rest_gate": Variant("an arm at rest is updated too", GATE, open_gates=("at_rest",)),
    "no_repeat_gate": Variant("an image that comes again counts again", GATE, open_gates=("unchanged_code",)),
    **_each(COUNT, "max_particles", "at most {:,} poses at the start and after a lift", _COUNTS),
    **_each(BUDGET, "tested_poses", "at most {:,} poses of the codebook are tested at a keyframe", _TESTED),
    **_each(BUDGET, "alignments_per_second", "{:,} alignments a second", _WORK),
    "work_all": Variant("every pose that matters is aligned at every keyframe", BUDGET, {"alignments_per_second": 0}),
    **_each(BUDGET, "refined_modes", "modes aligned to every map: {}", _ALIGNED),
    "book_5k": Variant("codebook of 5,000 poses", INPUT, codebook_size=5_000),
    "book_10k": Variant("codebook of 10,000 poses", INPUT, codebook_size=10_000),
    "code_32": Variant("codes cut to 32 numbers", INPUT, code_length=32),
    "code_16": Variant("codes cut to 16 numbers", INPUT, code_length=16),
    "code_8": Variant("codes cut to 8 numbers", INPUT, code_length=8),
    "contact_1": Variant("one contact of each grasp", CONTACTS, contacts=1),
    "contacts_2": Variant("two contacts, opposite", CONTACTS, contacts=2),
    "contacts_3": Variant("three contacts", CONTACTS, contacts=3),
}


def _group(*groups: str) -> tuple[str, ...]:
    return tuple(name for name, variant in VARIANTS.items() if variant.group in groups)


SETS = {
    "peers": ("paper", *_group(BASELINE)),
    "counts": _group(COUNT),
    "gates": _group(GATE),
    "codebooks": _group(INPUT),
    "ablation": _group(MECHANISM, GATE),
    "front": (*_group(PRESET, COUNT, BUDGET), "book_10k", "code_16"),
    "contacts": _group(CONTACTS),
}
"""Names for several variants at once; "all" is every one. "front" is what error is set against run time for: as much of
everything that can be had in more or less; mechanisms and other methods have sets of their own."""


def chosen_variants(names: list[str]) -> list[str]:
    """Variants by name or by the name of a set, the default first, none twice; InputError for an unknown name."""
    chosen = [DEFAULT]
    for name in names:
        if name == "all":
            chosen += VARIANTS
        elif name in SETS:
            chosen += SETS[name]
        elif name in VARIANTS:
            chosen.append(name)
        else:
            known = ", ".join([*VARIANTS, *SETS, "all"])
            raise InputError(f"--variant {name}: not known; there are {known}")
    return list(dict.fromkeys(chosen))
