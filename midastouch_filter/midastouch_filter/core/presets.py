"""Named settings of the filter, between run time and error.

Launch files import this module in a Python that may lack the filter's libraries, so it imports none of them.
"""

from __future__ import annotations

from midastouch_common.errors import InputError

BALANCED, PAPER = "balanced", "paper"
PRESETS: dict[str, dict[str, int]] = {
    "fast": {"alignments_per_second": 1200, "refined_modes": 1},
    BALANCED: {},
    PAPER: {},
}
"""Settings of `FilterConfig` that differ from its defaults, by preset. `PAPER` is another filter (`PaperFilter`)."""


def preset(name: str) -> dict[str, int]:
    """Return the settings of a preset.

    Parameters
    ----------
    name
        A key of `PRESETS`.

    Returns
    -------
    dict
        Fields of `FilterConfig` that differ from their defaults.

    Raises
    ------
    InputError
        There is no preset of that name.
    """
    if name not in list(PRESETS):  # `in PRESETS` would fail on a list, which a file may hold as the name
        raise InputError(f"preset {name}: not known; there are {', '.join(PRESETS)}")
    return PRESETS[name]


def preset_in_words(name: str) -> str:
    """Return the description of a preset for help and tables."""
    if name == PAPER:
        return "the paper's own filter, as a baseline: one sensor, codes only"
    return ", ".join(f"{key} {value}" for key, value in PRESETS[name].items()) or "the defaults"


PRESETS_IN_WORDS = "; ".join(f"{name}: {preset_in_words(name)}" for name in PRESETS)
