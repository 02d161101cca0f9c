"""QoS profiles of all topics; no node sets a depth or reliability of its own."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def _profile(depth: int, reliable: bool, latched: bool = False) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def stream_publisher(depth: int = 5) -> QoSProfile:
    """Return the profile of images, clouds, codes, particles: reliable, so that any subscriber matches (REP 2003)."""
    return _profile(max(depth, 5), reliable=True)


def stream_subscriber(depth: int = 1, reliable: bool = False) -> QoSProfile:
    """Return the profile to receive the same streams. Live: best effort, the newest only. Replay: reliable and deep."""
    return _profile(depth, reliable)


def stage_publisher(depth: int = 5) -> QoSProfile:
    """Return the profile for clouds and codes between stages: as `stream_publisher`, and latched.

    The first stage may process an image before it has discovered the second, and a replay must lose no message.
    """
    return _profile(max(depth, 5), reliable=True, latched=True)


def stage_subscriber(depth: int, reliable: bool) -> QoSProfile:
    """Return the profile to receive clouds and codes; if reliable (replay), also those sent before the subscription."""
    return _profile(depth, reliable, latched=reliable)


def latched(depth: int = 1) -> QoSProfile:
    """Return the profile, for both sides, of status, estimate and mesh: a late subscriber receives the last message.

    A depth above 1 keeps a burst together for a listener that needs every message (a lossless replay).
    """
    return _profile(depth, reliable=True, latched=True)


COMMAND = _profile(5, reliable=True)
"""Profile of `initialpose` and `object_pose_prior`, which are rare and must arrive."""

INTERACTIVE_MARKERS = _profile(100, reliable=True)
"""Profile of `update` and `feedback`, the same as RViz's: a viewer that misses an update has to start again."""

TF = _profile(100, reliable=True)
"""Profile of `/tf`, as in tf2_ros."""

TF_SUBSCRIBER = _profile(1000, reliable=True)
"""Profile to receive `/tf` without loss: the depth holds two seconds of an arm at 500 Hz."""

TF_STATIC_SUBSCRIBER = _profile(100, reliable=True, latched=True)
"""Profile to receive `/tf_static`, as in tf2_ros."""
