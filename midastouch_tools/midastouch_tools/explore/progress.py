"""Progress line of an exploration."""

from __future__ import annotations

from collections.abc import Mapping

_LONGEST_NAME = 30  # with it, a line has at most 100 columns


def progress_line(
    state: str, path_length: float, seconds: float, answer: str, filter_state: str, mode_mass: float
) -> str:
    """Return a line of at most 100 columns: the explorer's state, its path [m], seconds since the start, which object
    it is, the filter's state and the probability of its best pose [0 to 1].

    answer: from `object_answer`.
    """
    done = f"{state}, {1e3 * path_length:.0f} mm, {seconds:.0f} s"
    return f"{done} | {answer} | {filter_state}, best pose {mode_mass:.0%}"


def object_answer(objects: Mapping[str, float], given: str) -> str:
    """Return the name of the most probable object with its probability. Without probabilities, return `given`, the name
    of the object that the filter was given, or "no object yet" if that is empty."""
    if objects:
        name = max(objects, key=objects.get)
        return f"{_shortened(name)} {objects[name]:.0%}"
    return _shortened(given) if given else "no object yet"


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 3]}..."
