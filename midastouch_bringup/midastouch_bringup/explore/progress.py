"""The line that shows how far an exploration is."""

from __future__ import annotations

from collections.abc import Mapping

_LONGEST_NAME = 30  # with it, a line has at most 100 columns


def progress_line(
    state: str, path_length: float, seconds: float, answer: str, filter_state: str, mode_mass: float
) -> str:
    """The explorer's state, its path [m], seconds since the start, which object it is, the filter's state and the
    probability of its best pose [0 to 1], in at most 100 columns.

    answer: as of `object_answer`.
    """
    done = f"{state}, {1e3 * path_length:.0f} mm, {seconds:.0f} s"
    return f"{done} | {answer} | {filter_state}, best pose {mode_mass:.0%}"


def object_answer(objects: Mapping[str, float], given: str) -> str:
    """The most probable of the objects by name, with its probability; `given`, the name that the filter was given, if
    there are none, or that none is known if it was given none."""
    if objects:
        name = max(objects, key=objects.get)
        return f"{_shortened(name)} {objects[name]:.0%}"
    return _shortened(given) if given else "no object yet"


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 3]}..."
