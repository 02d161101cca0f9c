"""Every number the filter can be tuned by, with its unit, range and meaning."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from midastouch_common.errors import InputError


def _number(default: float, low: float, high: float, unit: str, doc: str, former: str = ""):
    """Return a dataclass field that carries everything a parameter server or a table needs to know about it."""
    return field(default=default, metadata={"low": low, "high": high, "unit": unit, "doc": doc, "former": former})


def _switch(default: bool, doc: str, former: str = ""):
    return field(default=default, metadata={"unit": "", "doc": doc, "former": former})


@dataclass(frozen=True)
class FilterConfig:
    """Settings of `ParticleFilter`. Raises InputError, naming the parameter, on a value out of range.

    Each field's metadata holds `doc`, `unit`, `former` (a name it had before, or "") and, for numbers, `low` and `high`
    (inclusive), so that nodes can declare their parameters and documents can list them without repeating anything.
    """

    # --- hypotheses
    max_particles: int = _number(
        20_000, 100, 5_000_000, "", "most poses of a codebook that are hypotheses at the start and after a lift"
    )
    refined_modes: int = _number(4, 1, 64, "", "modes that are aligned to every map, heaviest first")
    tested_poses: int = _number(300, 1, 100_000, "", "most poses of the codebook that are compared with a keyframe")
    alignments_per_second: int = _number(
        3600, 0, 1_000_000, "1/s", "descents of hypotheses to maps, what bounds the work of a core; 0: no limit"
    )
    keyframe_spacing: float = _number(
        0.012, 1e-3, 0.2, "m", "path from one keyframe to the next; 1 rad counts as 10 mm", former="smoothing_spacing"
    )

    # --- motion model (paper equation 1)
    drift_translation: float = _number(
        8e-3, 0.0, 0.1, "m/sqrt(m)", "error of the odometry that adds up, each axis, sigma after one metre of path"
    )
    drift_rotation: float = _number(
        0.15, 0.0, 3.0, "rad/sqrt(m)", "error of the odometry that adds up, each axis, sigma after one metre of path"
    )
    update_min_d: float = _number(2e-4, 0.0, 0.1, "m", "the arm is at rest until it has moved this far")
    update_min_a: float = _number(math.radians(0.2), 0.0, 1.0, "rad", "... or turned this far")
    max_odometry_jump: float = _number(0.5, 0.01, 10.0, "m", "one step longer than this starts the filter again")

    # --- codes (paper equation 2, made a calibrated likelihood ratio)
    temperature: float = _number(0.0, 0.0, 10.0, "", "of the code similarity; 0: the codebook's calibrated one")
    outlier: float = _number(0.0, 0.0, 0.9, "", "fraction of touches that match nothing; 0: the codebook's")

    # --- penetration maps; jitter as that of the paper's tracker (section 5)
    refinement: bool = _switch(True, "compare hypotheses with penetration maps; off: with codes only")
    jitter_translation: float = _number(5e-4, 1e-6, 0.05, "m", "error of one measured sensor pose, each axis, sigma")
    jitter_rotation: float = _number(
        math.radians(1.0), 1e-5, 1.0, "rad", "error of one measured sensor pose, each axis, sigma"
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

    # --- changes
    change_lifted: float = _number(0.2, 0.0, 0.9, "", "probability that the object was moved while the gel was lifted")
    unknown_prior: float = _number(
        0.5, 0.0, 0.999, "", "prior probability that the object is not one of the known ones; 0: it is"
    )

    # --- further fingers on the same object
    finger_translation: float = _number(
        5e-4, 0.0, 0.05, "m", "error of a further finger's pose relative to the first one's, each axis, sigma"
    )
    finger_rotation: float = _number(
        math.radians(1.0), 0.0, 1.0, "rad", "error of a further finger's pose relative to the first one's, each axis"
    )

    # --- status
    converged_probability: float = _number(0.99, 0.5, 1.0, "", "converged: the dominant mode is this probable")
    converged_error: float = _number(0.005, 1e-4, 0.5, "m", "converged: the published covariance is no wider, RMS")
    converged_rotation: float = _number(
        math.radians(15.0), 0.01, 3.0, "rad", "converged: the published pose is known no worse in rotation, RMS"
    )
    hysteresis: float = _number(1.5, 1.0, 5.0, "", "factor on the limits of a state before it is left")

    # --- machine
    threads: int = _number(0, 0, 256, "", "worker threads; 0: one per available core")

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


_ONE_RECURSION = "hypotheses are Gaussians now and are not resampled"
_NO_TEMPERING = "what odometry does not know is drift_translation and drift_rotation"
_ARM = "errors of mount and clock are part of drift_translation and drift_rotation"
_PUSH = "a push is within what drift_translation and drift_rotation allow"
_SURFACE = "maps say where the surface is"
GONE = {
    "min_particles": _ONE_RECURSION,
    "pf_err": _ONE_RECURSION,
    "pf_z": _ONE_RECURSION,
    "kld_sampling": _ONE_RECURSION,
    "resample_ess": _ONE_RECURSION,
    "region_radius": _ONE_RECURSION,
    "mode_radius": "what counts as one pose is fixed: 10 mm and 20 deg",
    "min_mode_mass": "modes are published down to a weight of 1e-5",
    "noise_translation": _NO_TEMPERING,
    "noise_rotation": _NO_TEMPERING,
    "noise_converged": _NO_TEMPERING,
    "noise_per_metre": _NO_TEMPERING,
    "noise_per_radian": _NO_TEMPERING,
    "max_penetration": _SURFACE,
    "max_hover": _SURFACE,
    "surface_sigma": _SURFACE,
    "dead_distance": _SURFACE,
    "book_constraint": _SURFACE,
    "refine_translation": "every hypothesis that matters is compared with maps",
    "refine_rotation": "every hypothesis that matters is compared with maps",
    "smoothing": "competing hypotheses are compared in any case; refinement: false does without maps",
    "hindsight": "competing hypotheses are compared in any case; refinement: false does without maps",
    "smoothing_touches": "nothing is compared twice, so no touches are kept",
    "hindsight_touches": "nothing is compared twice, so no touches are kept",
    "hindsight_spacing": "it is now keyframe_spacing",
    "object_motion": _PUSH,
    "object_jump_translation": _PUSH,
    "object_jump_rotation": _PUSH,
    "correlation_length": "touches a keyframe_spacing apart count in full, nearer ones in part",
    "calibration": _ARM,
    "mount_translation": _ARM,
    "mount_rotation": _ARM,
    "clock_offset": _ARM,
    "recovery": "hypotheses are born where touches contradict all others",
    "recovery_fraction": "hypotheses are born where touches contradict all others",
    "recovery_share": "hypotheses are born where touches contradict all others",
    "recovery_alpha_slow": "hypotheses are born where touches contradict all others",
    "recovery_alpha_fast": "hypotheses are born where touches contradict all others",
    "converged_mass": "a mode's weight is its probability: converged_probability",
    "converged_translation": "a mode's covariance is that of its pose: converged_error",
}
"""Former fields, and what replaces each of them."""


def by_present_names(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Replace former names of fields in settings by the present ones, with a FutureWarning that names both.

    Raises InputError if both are given, and on a field that is `GONE`.
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
