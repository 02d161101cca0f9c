"""What an arm can be asked to do, as the actions `touch`, `slide`, `lift` and `approach` have it, and how it went."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np


@dataclass(frozen=True)
class Touch:
    """On until something touches, at most `distance` m; direction (3,) in the gel's frame."""

    distance: float
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Slide:
    """On along the surface for `length` m, heading [rad] in the gel's plane, from its x to its y axis."""

    heading: float
    length: float


@dataclass(frozen=True)
class Lift:
    """Straight off the surface by `height` m."""

    height: float


@dataclass(frozen=True)
class Approach:
    """Through the air to a pose T_base_gel (4, 4)."""

    pose: np.ndarray


Act = Touch | Slide | Lift | Approach


@dataclass(frozen=True)
class CheckReach:
    """No act, but a question to whoever knows the arm: whether it reaches all of these poses T_base_gel (N, 4, 4)."""

    poses: np.ndarray


@dataclass(frozen=True)
class Done:
    """How an act ended: whether it did what was asked, in words; path [m] that the gel went; whether it touches then;
    pose T_base_gel (4, 4) then."""

    success: bool
    message: str
    path: float
    touching: bool
    pose: np.ndarray


_T, _Y, _S = TypeVar("_T"), TypeVar("_Y"), TypeVar("_S")
Plan = Generator[Act | CheckReach, Done, _T]
"""Acts one after the other, each chosen by how those before it went; of a question, `success` is the answer."""


def carried_out(
    plan: Plan[_T], carry_out: Callable[[Act | CheckReach], Generator[_Y, _S, Done]]
) -> Generator[_Y, _S, _T]:
    """What carrying out one act after the other yields; returns what the plan came to."""
    done = None
    while True:
        try:
            act = plan.send(done)
        except StopIteration as end:
            return end.value
        done = yield from carry_out(act)
