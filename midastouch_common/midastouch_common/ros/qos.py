"""QoS profiles, named once. No node writes a raw depth or reliability."""

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
    """Images, clouds, codes, particles: reliable, so that every kind of subscriber matches (REP 2003)."""
    return _profile(max(depth, 5), reliable=True)


def stream_subscriber(depth: int = 1, reliable: bool = False) -> QoSProfile:
    """The same streams, received. Live: best effort and the newest only. Replay: reliable and deep."""
    return _profile(depth, reliable)


def stage_publisher(depth: int = 5) -> QoSProfile:
    """Clouds and codes between stages: as `stream_publisher`, and latched.

    The first stage may process an image before it has discovered the second, and a replay must lose none.
    """
    return _profile(max(depth, 5), reliable=True, latched=True)


def stage_subscriber(depth: int, reliable: bool) -> QoSProfile:
    """Clouds and codes, received. In a replay also those sent before the subscription; live only the newest."""
    return _profile(depth, reliable, latched=reliable)


def latched(depth: int = 1) -> QoSProfile:
    """Status, estimate, mesh: a subscriber that comes late sees the last one. For both sides.

    A depth above 1 keeps a burst together for a listener that counts on every message (a lossless replay).
    """
    return _profile(depth, reliable=True, latched=True)


COMMAND = _profile(5, reliable=True)
"""`initialpose`, `object_pose_prior`: rare, must arrive."""

INTERACTIVE_MARKERS = _profile(100, reliable=True)
"""Their `update` and `feedback`, as RViz has them: a viewer that misses an update begins anew."""

TF = _profile(100, reliable=True)
"""`/tf`, as tf2_ros."""

TF_SUBSCRIBER = _profile(1000, reliable=True)
"""`/tf`, received where none may be lost: two seconds of an arm at 500 Hz."""

TF_STATIC_SUBSCRIBER = _profile(100, reliable=True, latched=True)
"""`/tf_static`, as tf2_ros."""
