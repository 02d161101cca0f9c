"""Contacts in images, each with the cloud of its points: the two come on two topics."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import points_from_msg, stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.managed_node import ManagedNode
from midastouch_msgs.msg import TactileContact

_LARGEST_GEL = 0.1  # m
_HALVES = 8  # most contacts whose points are still to come, or points whose contact is


class TouchImages:
    """Listener to contacts and clouds from its construction on; the node destroys its subscriptions. on_image: called
    with each contact and its points (K, 3) [m] in the gel's frame."""

    def __init__(self, node: ManagedNode, depth: int, on_image: Callable[[TactileContact, np.ndarray], None]):
        self._problem, self._on_image = node.diagnostics.problem, on_image
        self._halves: dict[int, dict[type, TactileContact | PointCloud2]] = {}  # by stamp [ns]
        node.create_subscription(TactileContact, "tactile/contact", self._on_contact, qos.stream_subscriber(depth))
        node.create_subscription(PointCloud2, "tactile/points", self._on_points, qos.stage_subscriber(depth, False))

    def _on_contact(self, msg: TactileContact) -> None:
        if not (0 <= msg.depth < math.inf and 0 <= msg.area < math.inf):
            self._problem("bad_contacts", f"tactile/contact: {msg.depth:g} m deep, {msg.area:g} m^2")
            return
        self._half(msg, msg.header if msg.in_contact else None)

    def _on_points(self, msg: PointCloud2) -> None:
        self._half(msg, msg.header)

    def _half(self, msg: TactileContact | PointCloud2, of: Header | None) -> None:
        """Take a contact or its points; `of`: header that the other half has, too, None if no other half is needed."""
        if of is None:
            self._on_image(msg, np.zeros((0, 3)))
            return
        stamp = stamp_ns(of.stamp)
        halves = self._halves.setdefault(stamp, {})
        halves[type(msg)] = msg
        if len(halves) == 2:
            del self._halves[stamp]
            try:
                points = points_from_msg(halves[PointCloud2])
                if np.abs(points).max(initial=0.0) > _LARGEST_GEL:
                    raise InputError(f"points more than {_LARGEST_GEL:g} m from the gel's apex")
                self._on_image(halves[TactileContact], points)
            except InputError as error:
                self._problem("bad_clouds", f"tactile/points: {error}")
        while len(self._halves) > _HALVES:
            del self._halves[next(iter(self._halves))]
