"""Why a transform cannot be stored or looked up."""

from __future__ import annotations


class TransformError(Exception):
    """A transform cannot be stored or looked up; the message names the frames and the reason."""


class InvalidTransformError(TransformError):
    """The transform offered is not a rigid transform between two frames of a tree."""


class UnknownFrameError(TransformError):
    """A frame was never mentioned; it may still come."""


class DisconnectedError(TransformError):
    """Both frames are known, but no chain of transforms links them (yet)."""


class PastExtrapolationError(TransformError):
    """The stamp is older than the history kept; waiting does not help."""


class FutureExtrapolationError(TransformError):
    """The stamp is newer than the newest transform; wait for the next one."""
