"""Variants compared on the same slides: presets, a mechanism off, less work, smaller codebooks, other methods."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.config import FilterConfig
from midastouch_filter.core.presets import PRESETS, preset_in_words
from midastouch_filter.core.touch import Measurement
from midastouch_filter.filter import ParticleFilter
from midastouch_filter.paper_filter import PaperFilter
from midastouch_perception.codebook import Codebook
from midastouch_tools.view import require_open3d

from ..baselines.registration import DeadReckoning, Registration
from .trial import AnyFilter, TrialFrame

DEFAULT, PRESET = "default", "preset"
PAPER, BASELINE, MECHANISM, GATE = "paper", "peer", "mechanism", "gate"
BUDGET, CONTACTS = "budget", "contacts"


@dataclasses.dataclass(frozen=True)
class Variant:
    """Differences from the default.

    summary: a line for tables; group: kind of difference; method: if it is not ours; settings: fields of
    `FilterConfig`, which no other method has; open_gates: names of the filter's gates that let everything pass;
    codebook_size: poses, if not the plan's; codes: whether the filter is given them; contacts: number of fingers of a
    grasp whose touches are used, if not all.
    """

    summary: str
    group: str
    settings: dict[str, Any] = dataclasses.field(default_factory=dict)
    open_gates: tuple[str, ...] = ()
    codebook_size: int | None = None
    codes: bool = True
    contacts: int | None = None
    method: str = ""

    @property
    def missing(self) -> str:
        """Reason why it cannot be run here; "" if it can."""
        if self.method == "registration":
            try:
                require_open3d()
            except InputError as error:
                return str(error)
        return ""

    def frame(self, frame: TrialFrame) -> TrialFrame:
        """Return the frame as the filter is given it; methods other than ours know the first finger only."""
        count = 1 if self.method else self.contacts
        others = dict(list(frame.others.items())[: None if count is None else count - 1])
        touches = [self._touch(touch) for touch in others.values()]
        return dataclasses.replace(
            frame, measurement=self._touch(frame.measurement), others=dict(zip(others, touches, strict=True))
        )

    def _touch(self, touch: Measurement) -> Measurement:
        if self.codes or touch.code is None:
            return touch
        return dataclasses.replace(touch, code=_alike(touch.code))

    def codebook(self, codebook: Codebook) -> Codebook:
        """Return the codebook as the filter is given it."""
        return codebook if self.codes else Codebook(codebook.poses, _alike(codebook.codes), codebook.meta)

    @property
    def inputs(self) -> dict[str, object]:
        """Differences in addition to the settings, by name."""
        inputs = {name: getattr(self, name) for name in ("open_gates", "codebook_size", "contacts")}
        return {name: value for name, value in inputs.items() if value} | ({} if self.codes else {"codes": False})

    def describe(self) -> dict:
        """Return, for the JSON, summary, group and all that differs from the default."""
        return {"summary": self.summary, "group": self.group} | self.settings | self.inputs

    def config(self, base: FilterConfig, threads: int) -> FilterConfig:
        """Return the settings of our filter: the variant's laid over `base`."""
        return dataclasses.replace(base, **({"threads": threads} | self.settings))

    def filter(self, mesh: ObjectMesh, codebook: Codebook, base: FilterConfig, threads: int) -> AnyFilter:
        """Return a filter of this variant, its stages timed."""
        clock = time.perf_counter
        match self.method:
            case "paper":
                return PaperFilter(mesh, codebook, clock=clock, threads=threads)
            case "odometry":
                return DeadReckoning(mesh, codebook, clock)
            case "registration":
                return Registration(mesh, codebook, clock)
        return ParticleFilter(mesh, codebook, self.config(base, threads), clock=clock, open_gates=self.open_gates)


def _alike(codes: np.ndarray) -> np.ndarray:
    """Return unit codes (..., D) that are all the same."""
    return np.full_like(codes, codes.shape[-1] ** -0.5)


def _each(setting: str, summary: str, values: dict[str, int]) -> dict[str, Variant]:
    """Return variants by name that set `setting` to one of the values; summary: with a gap for the value."""
    return {name: Variant(summary.format(value), BUDGET, {setting: value}) for name, value in values.items()}


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
    "registration": Variant("FPFH, RANSAC and ICP of the accumulated contact cloud", BASELINE, method="registration"),
    "odometry": Variant("the arm's odometry alone, from one draw of the start", BASELINE, method="odometry"),
    "no_maps": Variant("codes only: nothing is compared with penetration maps", MECHANISM, {"refinement": False}),
    "no_codes": Variant("maps only: every touch has the same code", MECHANISM, codes=False),
    "no_drift": Variant(
        "the odometry is believed not to drift", MECHANISM, {"drift_translation": 0.0, "drift_rotation": 0.0}
    ),
    "no_lift": Variant(
        "nothing is born after a lift: the object is believed to rest", MECHANISM, {"change_lifted": 0.0}
    ),
    "no_rest_gate": Variant("an arm at rest is updated too", GATE, open_gates=("at_rest",)),
    "no_repeat_gate": Variant("an image that comes again counts again", GATE, open_gates=("unchanged_code",)),
    **_each(
        "alignments_per_second", "{:,} descents a second", {"work_360": 360, "work_1200": 1200, "work_12000": 12_000}
    ),
    **_each(
        "tested_poses",
        "at most {:,} poses of the codebook are tested at a keyframe",
        {"test_30": 30, "test_100": 100, "test_1000": 1_000},
    ),
    **_each("refined_modes", "modes aligned to every map: {}", {"align_1": 1}),
    **_each("max_particles", "at most {:,} poses at the start and after a lift", {"5k": 5_000, "50k": 50_000}),
    "book_5k": Variant("codebook of 5,000 poses", BUDGET, codebook_size=5_000),
    "book_10k": Variant("codebook of 10,000 poses", BUDGET, codebook_size=10_000),
    "contact_1": Variant("the thumb alone", CONTACTS, contacts=1),
    "contacts_2": Variant("the thumb and one finger", CONTACTS, contacts=2),
}


def _group(*groups: str) -> tuple[str, ...]:
    return tuple(name for name, variant in VARIANTS.items() if variant.group in groups)


SETS = {
    "peers": _group(PAPER, BASELINE),
    "gates": _group(GATE),
    "ablation": _group(MECHANISM, GATE),
    "front": _group(PRESET, BUDGET),
    "contacts": _group(CONTACTS),
}
"""Names for several variants at once; "all" is every one. "front" is for plots of error against run time: all variants
with more or less of something; mechanisms and other methods have sets of their own."""


def chosen_variants(names: list[str]) -> list[str]:
    """Return variants by their name or that of a set, the default first, none twice; InputError for an unknown name."""
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
