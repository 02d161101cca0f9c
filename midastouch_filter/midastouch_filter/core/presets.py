"""Named settings of the filter, between run time and error.

Launch files read this module, in a Python that need not have the filter's libraries: it imports none of them.
"""

from __future__ import annotations

from midastouch_common.errors import InputError

BALANCED, PAPER = "balanced", "paper"
PRESETS: dict[str, dict[str, int]] = {
    "fast": {"alignments_per_second": 600, "refined_modes": 1},
    BALANCED: {},
    PAPER: {},
}
"""By name, the settings of `FilterConfig` that differ from its defaults. `PAPER` is another filter (`PaperFilter`)."""


def preset(name: str) -> dict[str, int]:
    """Settings of a preset; InputError for an unknown name."""
    if name not in list(PRESETS):  # a file may hold anything, a list too
        raise InputError(f"preset {name}: not known; there are {', '.join(PRESETS)}")
    return PRESETS[name]


def preset_in_words(name: str) -> str:
    """For help and tables."""
    if name == PAPER:
        return "the paper's own filter, as a baseline: one sensor, codes only"
    return ", ".join(f"{key} {value}" for key, value in PRESETS[name].items()) or "the defaults"


PRESETS_IN_WORDS = "; ".join(f"{name}: {preset_in_words(name)}" for name in PRESETS)
