"""Acts that an arm can be asked for, as in the actions `touch`, `slide`, `lift` and `approach`, and their results."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np


@dataclass(frozen=True)
class Touch:
    """Motion until something touches, at most `distance` m; direction (3,): in the gel's frame."""

    distance: float
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Slide:
    """Motion along the surface for `length` m; heading [rad]: in the gel's plane, from its x to its y axis."""

    heading: float
    length: float


@dataclass(frozen=True)
class Lift:
    """Motion straight off the surface by `height` m."""

    height: float


@dataclass(frozen=True)
class Approach:
    """Motion through the air to a pose T_base_gel (4, 4)."""

    pose: np.ndarray


Act = Touch | Slide | Lift | Approach


@dataclass(frozen=True)
class CheckReach:
    """Question, not an act: does the arm reach all of these poses T_base_gel (N, 4, 4)?"""

    poses: np.ndarray


@dataclass(frozen=True)
class Done:
    """End of an act. success: True if it did what was asked; message: its end in words; path [m]: of the gel;
    touching, pose T_base_gel (4, 4): at the end."""

    success: bool
    message: str
    path: float
    touching: bool
    pose: np.ndarray


_T = TypeVar("_T")
_Y = TypeVar("_Y")
_S = TypeVar("_S")
Plan = Generator[Act | CheckReach, Done, _T]
"""Generator of acts, each chosen by the ends of those before it; for a question, `success` is the answer."""


def carried_out(
    plan: Plan[_T], carry_out: Callable[[Act | CheckReach], Generator[_Y, _S, Done]]
) -> Generator[_Y, _S, _T]:
    """Carry out the acts of a plan in turn; yields what `carry_out` yields, returns the plan's result."""
    done = None
    while True:
        try:
            act = plan.send(done)
        except StopIteration as end:
            return end.value
        done = yield from carry_out(act)
