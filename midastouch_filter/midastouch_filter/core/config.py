"""Every number the filter can be tuned by, with its unit, range and meaning."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from midastouch_common.errors import InputError


def _number(default: float, low: float, high: float, unit: str, doc: str, former: str = ""):
    """A dataclass field that carries what a parameter server or a table needs to know about it."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "doc": doc, "former": former})


def _switch(default: bool, doc: str, former: str = ""):
    return field(default=default, metadata={"unit": "", "doc": doc, "former": former})


@dataclass(frozen=True)
class FilterConfig:
    """Settings of `ParticleFilter`. Raises InputError, naming the parameter, on a value out of range.

    Each field's metadata holds `doc`, `unit`, `former` (a name it had before, or "") and, for numbers, `low` and `high`
    (inclusive), so that nodes can declare their parameters and documents can list them without repeating anything.
    """

    # --- number of particles (paper appendix C; KLD sampling, Fox 2001)
    min_particles: int = _number(500, 1, 1_000_000, "", "fewest particles")
    max_particles: int = _number(5_000, 1, 5_000_000, "", "most particles; also the number at the start")
    pf_err: float = _number(0.02, 1e-3, 0.5, "", "KLD sampling: allowed divergence from the true distribution")
    pf_z: float = _number(
        3.0, 0.0, 6.0, "", "KLD sampling: quantile of the standard normal, not a probability (3 means 99.87 %)"
    )
    region_radius: float = _number(
        0.005, 1e-3, 0.05, "m", "of the SE(3) cells for KLD sampling and clustering; 1 rad counts as 10 mm"
    )
    kld_sampling: bool = _switch(True, "adapt the number of particles; off keeps max_particles")

    # --- motion model (paper equation 1)
    noise_translation: float = _number(1e-3, 0.0, 0.05, "m", "noise per step in contact, each axis, sigma")
    noise_rotation: float = _number(math.radians(2.0), 0.0, 1.0, "rad", "noise per step in contact, each axis, sigma")
    noise_converged: float = _number(0.25, 0.0, 1.0, "", "fraction of both that is left once one mode dominates")
    noise_per_metre: float = _number(0.02, 0.0, 1.0, "m/m", "further translation noise per distance moved")
    noise_per_radian: float = _number(0.02, 0.0, 1.0, "rad/rad", "further rotation noise per angle turned")
    update_min_d: float = _number(2e-4, 0.0, 0.1, "m", "the arm is at rest until it has moved this far")
    update_min_a: float = _number(math.radians(0.2), 0.0, 1.0, "rad", "... or turned this far")
    max_odometry_jump: float = _number(0.5, 0.01, 10.0, "m", "one step longer than this starts the filter again")

    # --- measurement model (paper equation 2, made a calibrated likelihood ratio)
    temperature: float = _number(0.0, 0.0, 10.0, "", "of the code similarity; 0: the codebook's calibrated one")
    outlier: float = _number(0.0, 0.0, 0.9, "", "fraction of touches that match nothing; 0: the codebook's")
    correlation_length: float = _number(
        0.02, 1e-5, 0.1, "m", "touches nearer count in part only, unless a map fits nothing; 1 rad counts as 10 mm"
    )

    # --- surface constraint (paper appendix C, pruning)
    max_penetration: float = _number(2e-3, 0.0, 0.02, "m", "the gel's apex may lie this deep in the object for free")
    max_hover: float = _number(1e-3, 0.0, 0.02, "m", "... and this far above its surface")
    surface_sigma: float = _number(1e-3, 1e-5, 0.02, "m", "softness of both limits")
    dead_distance: float = _number(6e-3, 1e-3, 0.02, "m", "particles farther from the surface than this are dropped")
    book_constraint: bool = _switch(True, "weigh down particles far from every codebook pose (tilted away)")

    # --- coarse to fine: alignment of narrow modes to the measured map; jitter as of the paper's tracker (section 5)
    refinement: bool = _switch(True, "align narrow modes to the measured penetration map")
    refined_modes: int = _number(4, 1, 64, "", "modes that are aligned, heaviest first")
    refine_translation: float = _number(0.008, 1e-4, 0.05, "m", "a mode is narrow below this RMS spread ...")
    refine_rotation: float = _number(math.radians(24.0), 0.01, 1.5, "rad", "... and below this one in rotation")
    jitter_translation: float = _number(5e-4, 0.0, 0.05, "m", "error of one measured sensor pose, each axis, sigma")
    jitter_rotation: float = _number(
        math.radians(1.0), 0.0, 1.0, "rad", "error of one measured sensor pose, each axis, sigma"
    )
    penetration_fit: float = _number(
        0.6, 0.0, 1.0, "", "fraction of touched pixels a pose must explain to be believed", former="relief_fit"
    )
    penetration_noise: float = _number(
        1e-4, 1e-6, 1e-2, "m", "error of a measured penetration map, sigma", former="relief_noise"
    )
    penetration_correlation: float = _number(
        4e-3, 1e-4, 0.05, "m", "length over which that error is one and the same", former="relief_correlation"
    )

    # --- fixed-lag smoothing: other poses that explain the last touches as well
    smoothing: bool = _switch(
        True, "re-evaluate the last touches at competing pose hypotheses; needs refinement", former="hindsight"
    )
    smoothing_touches: int = _number(
        16, 2, 200, "", "touches that are kept, the older the sparser", former="hindsight_touches"
    )
    smoothing_spacing: float = _number(
        0.012, 1e-3, 0.2, "m", "path between two of them; 1 rad counts as 10 mm", former="hindsight_spacing"
    )

    # --- another object may be touched
    unknown_prior: float = _number(
        0.5, 0.0, 0.999, "", "probability beforehand that it is none of the known objects; 0: it is one of them"
    )

    # --- the object may move: contact odometry against the arm's
    object_motion: bool = _switch(True, "follow the object when it slips or is pushed; needs refinement")
    object_jump_translation: float = _number(
        0.003, 1e-4, 0.05, "m", "size of the jumps of the object that are looked for, each axis, sigma"
    )
    object_jump_rotation: float = _number(
        math.radians(3.0), 1e-3, 0.5, "rad", "size of the jumps of the object that are looked for, each axis, sigma"
    )

    # --- self-calibration while sliding
    calibration: bool = _switch(True, "learn the errors of mount and clock while sliding; needs refinement")
    mount_translation: float = _number(2e-3, 1e-6, 0.02, "m", "error of the mount, each axis, sigma")
    mount_rotation: float = _number(math.radians(2.0), 1e-6, 0.3, "rad", "error of the mount, each axis, sigma")
    clock_offset: float = _number(0.05, 1e-6, 0.5, "s", "offset of the arm's clock to the camera's, sigma")

    # --- further fingers on the same object
    finger_translation: float = _number(
        5e-4, 0.0, 0.05, "m", "error of a further finger's pose relative to the first one's, each axis, sigma"
    )
    finger_rotation: float = _number(
        math.radians(1.0), 0.0, 1.0, "rad", "error of a further finger's pose relative to the first one's, each axis"
    )

    # --- recovery
    recovery_fraction: float = _number(
        0.1,
        0.0,
        0.9,
        "",
        "without refinement: largest fraction of particles that the codebook's best matches replace at a time when the "
        "likelihood collapses",
        former="recovery_share",
    )

    # --- modes and status
    mode_radius: float = _number(0.012, 1e-3, 0.2, "m", "peaks nearer than this may be one mode; 1 rad is 10 mm")
    min_mode_mass: float = _number(0.01, 0.0, 0.5, "", "modes lighter than this are not reported")
    converged_mass: float = _number(0.8, 0.5, 1.0, "", "converged: the dominant mode holds this much")
    converged_probability: float = _number(
        0.99,
        0.5,
        1.0,
        "",
        "converged: the dominant mode is this probable, by the last touches, among all that explain them",
    )
    converged_translation: float = _number(0.005, 1e-4, 0.1, "m", "converged: its particles spread no wider, RMS")
    converged_rotation: float = _number(
        math.radians(15.0), 0.01, 3.0, "rad", "converged: its particles, and the published pose, turn no wider, RMS"
    )
    converged_error: float = _number(
        0.005,
        1e-4,
        0.5,
        "m",
        "converged: the published covariance is no wider, RMS; innovations and residuals widen it",
    )
    hysteresis: float = _number(1.5, 1.0, 5.0, "", "factor on the limits of a state before it is left")

    # --- machine
    threads: int = _number(0, 0, 256, "", "worker threads; 0: one per available core")

    @property
    def jitter(self) -> np.ndarray:
        """Covariance (6, 6) of one measured sensor pose, in its own frame: m^2, rad^2."""
        return np.diag(np.repeat([self.jitter_translation, self.jitter_rotation], 3) ** 2)

    @property
    def object_jump(self) -> np.ndarray:
        """Covariance (6, 6) of how far the object jumps, in the gel's frame: m^2, rad^2."""
        return np.diag(np.repeat([self.object_jump_translation, self.object_jump_rotation], 3) ** 2)

    @property
    def mount_error(self) -> np.ndarray:
        """Covariance (6, 6) of the mount's error, in the gel's frame: m^2, rad^2."""
        return np.diag(np.repeat([self.mount_translation, self.mount_rotation], 3) ** 2)

    @property
    def finger_error(self) -> np.ndarray:
        """Covariance (6, 6) of a further finger's pose, given the first one's, in its own frame: m^2, rad^2."""
        return np.diag(np.repeat([self.finger_translation, self.finger_rotation], 3) ** 2)

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.type == "bool":
                if not isinstance(value, bool):
                    raise InputError(f"parameter {item.name}: {value!r} is not true or false")
                continue
            integral = item.type == "int"
            if isinstance(value, bool) or not isinstance(value, int if integral else (int, float)):
                kind = "a whole number" if integral else "a number"
                raise InputError(f"parameter {item.name}: {value!r} is not {kind}")
            low, high = item.metadata["low"], item.metadata["high"]
            if not low <= value <= high:
                unit = f" {item.metadata['unit']}" if item.metadata["unit"] else ""
                raise InputError(f"parameter {item.name}: {value} is outside [{low}, {high}]{unit}")
        if self.min_particles > self.max_particles:
            raise InputError(
                f"parameter min_particles: {self.min_particles} is more than max_particles {self.max_particles}"
            )


GONE = {
    "resample_ess": "particles are resampled at every touch",
    "recovery": "without refinement the filter recovers; recovery_fraction 0.0 turns that off",
    "recovery_alpha_slow": "the long average of the likelihood has one rate",
    "recovery_alpha_fast": "the last touch is the short average of the likelihood",
}
"""Fields that there were, and what is in their place."""


def by_present_names(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings in which a former name of a field is replaced by the present one, with a FutureWarning that names both.

    Raises InputError where both are given, and on a field that is `GONE`.
    """
    for name in settings:
        if name in GONE:
            raise InputError(f"{name} is gone: {GONE[name]}")
    present = dict(settings)
    for item in fields(FilterConfig):
        former = item.metadata["former"]
        if former not in settings:
            continue
        if item.name in settings:
            raise InputError(f"{former} is now {item.name}, and both are given; give {item.name} only")
        warnings.warn(f"{former} is now {item.name}; rename it", FutureWarning, stacklevel=2)
        present[item.name] = present.pop(former)
    return present
