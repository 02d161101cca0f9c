"""Where frames are over time: the tree of their transforms, and what waits for one."""

from .buffer import TransformBuffer
from .errors import (
    DisconnectedError,
    FutureExtrapolationError,
    InvalidTransformError,
    PastExtrapolationError,
    TransformError,
    UnknownFrameError,
)
from .frame_tree import JUMP_S, SECOND, FrameTree, Insertion, Link, ancestors

__all__ = [
    "JUMP_S",
    "SECOND",
    "DisconnectedError",
    "FrameTree",
    "FutureExtrapolationError",
    "Insertion",
    "InvalidTransformError",
    "Link",
    "PastExtrapolationError",
    "TransformBuffer",
    "TransformError",
    "UnknownFrameError",
    "ancestors",
]
