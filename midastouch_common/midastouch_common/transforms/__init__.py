"""Transforms in time: the tree of frames, and the queue of items that wait for a transform."""

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
