"""Input of `contact_controller`: contacts, forces, the filter's state, `~/enable`, and the gel's pose on TF."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Bool

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import SECOND, stamp_ns
from midastouch_common.ros import qos
from midastouch_common.ros.managed_node import ManagedNode
from midastouch_common.ros.transform_source import TransformSource
from midastouch_common.transforms.rigid import TransformError
from midastouch_msgs.msg import FilterStatus, TactileContact
from midastouch_perception.sensor_model import SensorModel

from ..control.controller import Controller
from ..control.guard import UNREAD, Seen
from ..control.measured import Measured
from ..control.wrench import Sample
from .touch_images import TouchImages
from .twist_topic import followers_and_commanders


class Inputs:
    """Input of a controller, from the node's topics and TF, until it is closed.

    Attributes: controller; seen, what the guard sees; area [m^2] of the newest contact; pose [s], stamp of the gel's
    newest one, -inf before the first.

    Parameters
    ----------
    node
        Its parameters name the topics.
    controller
        Takes contacts and forces.
    sensor
    frames
        Of the base and of the gel.
    on_image
        Called after each contact.
    on_jump
        Called after time ran back.
    """

    def __init__(
        self,
        node: ManagedNode,
        controller: Controller,
        sensor: SensorModel,
        frames: tuple[str, str],
        on_image: Callable[[], None],
        on_jump: Callable[[], None],
    ):
        self._node, self._sensor, self._frames, self._on_image = node, sensor, frames, on_image
        self.controller = controller
        self._begin()
        node.create_subscription(Bool, "~/enable", self._on_enable, qos.COMMAND)
        TouchImages(node, node.parameters["queue_depth"], self._on_contact)
        node.create_subscription(FilterStatus, "filter_status", self._on_status, qos.latched())
        if topic := node.parameters["wrench_topic"]:
            node.create_subscription(WrenchStamped, topic, self._on_wrench, qos.stream_subscriber())
        # last: nothing would end its thread if something after it failed
        self._transforms = TransformSource(
            node,
            frames=self._frames,
            on_jump=lambda stamp: on_jump(),
            on_bad=lambda reason: node.diagnostics.problem("bad_transforms", reason),
        )

    def forget(self) -> None:
        """Forget all input, and the transforms, because time ran back."""
        self._transforms.forget()
        self._begin()

    def _begin(self) -> None:
        self.seen, self.area = Seen(), 0.0
        self.pose = self._image = self._force = -math.inf  # s: newest stamps, however far ahead

    def close(self) -> None:
        """Stop reading TF; the node destroys its subscriptions."""
        self._transforms.close()

    def look(self, topic: str) -> None:
        """Update the gel's pose, and the numbers of nodes on the topic of the twists."""
        self.seen.listeners, self.seen.commanders = followers_and_commanders(self._node, topic)
        try:
            newest = self._transforms.latest_stamp(*self._frames)
        except TransformError:
            return
        stamp = self._node.get_clock().now().nanoseconds if newest is None else newest
        pose = self._transforms.known(*self._frames, stamp)
        if pose is not None and stamp / SECOND > self.pose:
            self.pose, self.seen.gel = stamp / SECOND, pose
            self.seen.pose = self.controller.guard.counted(self._now(), self.pose)

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds / SECOND

    def _on_enable(self, msg: Bool) -> None:
        self.seen.enabled = self._now() if msg.data else -math.inf

    def _on_status(self, msg: FilterStatus) -> None:
        self.seen.lost = self._node.parameters["stop_if_lost"] and msg.state == FilterStatus.STATE_LOST

    def _on_contact(self, contact: TactileContact, points: np.ndarray) -> None:
        """Take a contact and its points (K, 3)."""
        stamp, now, guard = stamp_ns(contact.header.stamp) / SECOND, self._now(), self.controller.guard
        if early := guard.early("image", now, stamp):
            self._node.diagnostics.problem("early_images", f"tactile/contact: {early}; is the sensor's clock right?")
            return
        if stamp <= self._image:
            return
        depth = contact.depth if contact.in_contact else 0.0
        self.controller.servo.measure(now, Measured.of(stamp, depth, contact.area, points, self._sensor))
        self._image, self.area = stamp, float(contact.area)
        self.seen.unread, self.seen.image = UNREAD.get(contact.state, ""), guard.counted(now, stamp)
        self._on_image()

    def _on_wrench(self, msg: WrenchStamped) -> None:
        stamp, now, guard = stamp_ns(msg.header.stamp) / SECOND, self._now(), self.controller.guard
        if stamp <= self._force:
            return
        self.seen.wrench = guard.counted(now, stamp)
        if guard.early("force", now, stamp):
            return
        self._force = stamp
        try:
            sample = self._sample(stamp, msg)
        except InputError as error:
            self.seen.bad_wrench = f"wrench_topic: {error}"
            return
        self.seen.bad_wrench = ""
        self.controller.wrench.take(sample)
        self.seen.force = float(np.linalg.norm(self.controller.wrench.force))

    def _sample(self, stamp: float, msg: WrenchStamped) -> Sample:
        """Return the force of a message along the gel's axes; raises InputError if it cannot be used."""
        force = np.array([getattr(msg.wrench.force, axis) for axis in "xyz"])
        if not np.isfinite(force).all():
            raise InputError("the force is not finite")
        (base, gel), frame = self._frames, msg.header.frame_id
        try:
            along = self._transforms.newest(gel, frame)[:3, :3]
            up = self._transforms.newest(gel, base)[:3, 2]
        except TransformError as error:
            raise InputError(f"TF does not link its frame '{frame}' to the gel: {error}") from error
        return Sample(stamp, along @ force, up)
