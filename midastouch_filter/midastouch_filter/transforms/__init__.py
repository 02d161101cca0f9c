"""Where frames are over time: the tree of their transforms, and what waits for one."""

from .buffer import JUMP_S, Insertion, TransformBuffer, ancestors
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
