"""Where frames are over time: the tree of their transforms, and what waits for one."""

from .buffer import JUMP_S, SECOND, Insertion, TransformBuffer, ancestors
from .rigid import (
    DisconnectedError,
    FutureExtrapolationError,
    InvalidTransformError,
    PastExtrapolationError,
    TransformError,
    UnknownFrameError,
)

__all__ = [
    "JUMP_S",
    "SECOND",
    "DisconnectedError",
    "FutureExtrapolationError",
    "Insertion",
    "InvalidTransformError",
    "PastExtrapolationError",
    "TransformBuffer",
    "TransformError",
    "UnknownFrameError",
    "ancestors",
]
