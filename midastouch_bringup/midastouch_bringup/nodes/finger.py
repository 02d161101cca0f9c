"""A simulated finger as others see it: on TF, one image's time after the other, and as an interactive marker."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np
from geometry_msgs.msg import Point, Pose, TransformStamped, Vector3
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import ColorRGBA, Header
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerControl,
    InteractiveMarkerFeedback,
    InteractiveMarkerPose,
    InteractiveMarkerUpdate,
    Marker,
    MenuEntry,
)
from visualization_msgs.srv import GetInteractiveMarkers

from midastouch_common.message_arrays import point_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import pose_to_msg, stamp_from_ns, transform_to_msg
from midastouch_filter.transforms import SECOND

from ..bags.messages import TRUTH_GEL_FRAME
from ..explore.exploration import World


class FingerTf:
    """The time of the finger is its own: it goes on by one image, 1 / `fps` s, with each `publish`.

    Attributes: stamp [ns] of the newest; awaited, the stamps in order that nobody has answered; moved_at [s], when it
    last went on, by a clock that never stops.
    Args: frames, the names of `base`, `object` and `sensor`.
    """

    def __init__(self, node: Node, world: World, fps: float, frames: Mapping[str, str]):
        self._publisher = node.create_publisher(TFMessage, "/tf", qos.TF)
        self._world, self._frames, self._period = world, frames, round(SECOND / fps)
        self.stamp, self.moved_at = time.time_ns(), time.monotonic()
        self.awaited: deque[int] = deque()

    def publish(self) -> None:
        """Finger and object as they are now, one image later."""
        self.stamp += self._period
        self.moved_at = time.monotonic()
        self.awaited.append(self.stamp)
        world, frames = self._world, self._frames
        transforms = [
            self._transform(frames["base"], frames["object"], world.base_from_object),
            self._transform(frames["base"], frames["sensor"], world.base_from_gel),
            self._transform(frames["object"], TRUTH_GEL_FRAME, world.finger.pose),
        ]
        self._publisher.publish(TFMessage(transforms=transforms))

    def answered(self, stamp: int) -> bool:
        """Whether the image of a stamp [ns] was awaited; no longer, nor are those before it, which are lost."""
        if stamp not in self.awaited:
            return False
        while self.awaited and self.awaited[0] <= stamp:
            self.awaited.popleft()
        return True

    def _transform(self, parent: str, child: str, pose: np.ndarray) -> TransformStamped:
        header = Header(stamp=stamp_from_ns(self.stamp), frame_id=parent)
        return TransformStamped(header=header, child_frame_id=child, transform=transform_to_msg(pose))


_NAME = "finger"
_RATE = 10.0  # Hz; what the eye takes for a motion
_DIAMETER, _LENGTH = 0.01, 0.03  # m
_COLOUR = ColorRGBA(r=1.0, g=0.7, b=0.1, a=0.8)


class FingerMarker:
    """The finger of a world on `~/finger/...`, in the protocol of ROS 2's package `interactive_markers`.

    A viewer asks the service `get_interactive_markers` for all of them, then follows `update`, whose messages are
    numbered without a gap, and says on `feedback` what its user does. It asks again when a number is missing or the
    service was gone, so that nothing has to be sent to keep it. While its user drags it keeps updates back by itself.

    Args: frame, of the object; send(point, frame): lets the finger touch there; menu: what each entry does, returning
    why it cannot be or an empty text. problem(kind, words): is told what is wrong with a feedback.
    """

    def __init__(
        self,
        node: Node,
        world: World,
        frame: str,
        send: Callable[[np.ndarray, str], None],
        menu: Mapping[str, Callable[[], str]],
        problem: Callable[[str, str], None],
    ):
        self._world, self._send, self._problem = world, send, problem
        self._menu = dict(enumerate(menu.items(), start=1))  # 0 is no entry
        self._server = node.get_fully_qualified_name()
        self._header = Header(frame_id=frame)  # without a stamp: it moves along with the frame
        self._number, self._shown = 0, None
        self._grasped: tuple[str, np.ndarray] | None = None  # by which viewer, and where
        node.create_service(GetInteractiveMarkers, "~/finger/get_interactive_markers", self._on_request)
        self._updates = node.create_publisher(InteractiveMarkerUpdate, "~/finger/update", qos.INTERACTIVE_MARKERS)
        node.create_subscription(
            InteractiveMarkerFeedback, "~/finger/feedback", self._on_feedback, qos.INTERACTIVE_MARKERS
        )
        node.create_timer(1 / _RATE, self._follow, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- what viewers get

    def _on_request(self, _, response: GetInteractiveMarkers.Response) -> GetInteractiveMarkers.Response:
        entries = [MenuEntry(id=key, title=title) for key, (title, _) in self._menu.items()]
        pose = pose_to_msg(self._world.finger.pose)
        response.sequence_number = self._number
        response.markers = [
            InteractiveMarker(
                header=self._header, name=_NAME, pose=pose, scale=_LENGTH, menu_entries=entries, controls=[_control()]
            )
        ]
        return response

    def _follow(self) -> None:
        """Where the finger is, if that is another pose than the last one sent."""
        pose = self._world.finger.pose
        if pose is self._shown or not self._updates.get_subscription_count():
            return
        self._shown, self._number = pose, self._number + 1
        moved = InteractiveMarkerPose(header=self._header, name=_NAME, pose=pose_to_msg(pose))
        update = InteractiveMarkerUpdate.UPDATE
        self._updates.publish(
            InteractiveMarkerUpdate(server_id=self._server, seq_num=self._number, type=update, poses=[moved])
        )

    # --- what their users do

    def _on_feedback(self, did: InteractiveMarkerFeedback) -> None:
        position = point_from_msg(did.pose.position)
        if did.marker_name != _NAME:
            self._refuse(did, f"there is no marker '{did.marker_name}'; there is '{_NAME}'")
        elif not np.isfinite(position).all():
            self._refuse(did, f"its position is {position}")
        elif did.event_type == InteractiveMarkerFeedback.MOUSE_DOWN:
            self._grasped = did.client_id, position
        elif did.event_type == InteractiveMarkerFeedback.MOUSE_UP:
            self._release(did, position)
        elif did.event_type == InteractiveMarkerFeedback.MENU_SELECT:
            self._choose(did)

    def _release(self, did: InteractiveMarkerFeedback, position: np.ndarray) -> None:
        if self._grasped is None or self._grasped[0] != did.client_id:
            self._refuse(did, "it lets the finger go, which it has not grasped or another one has grasped since")
            return
        (_, before), self._grasped = self._grasped, None
        if (position != before).any():
            self._shown = None  # a viewer leaves it where it was dropped
            self._send(position, did.header.frame_id)

    def _choose(self, did: InteractiveMarkerFeedback) -> None:
        title, do = self._menu.get(did.menu_entry_id, ("", None))
        if do is None:
            self._refuse(did, f"the menu has no entry {did.menu_entry_id}")
        elif why_not := do():
            self._refuse(did, f"{title}: {why_not}")

    def _refuse(self, did: InteractiveMarkerFeedback, why: str) -> None:
        self._problem("refused_feedback", f"~/finger/feedback of '{did.client_id}': {why}")


def _control() -> InteractiveMarkerControl:
    """What is grasped: a finger that stands on the surface, and is dragged as the camera sees it."""
    finger = Marker(type=Marker.CYLINDER, scale=Vector3(x=_DIAMETER, y=_DIAMETER, z=_LENGTH), color=_COLOUR)
    finger.pose = Pose(position=Point(z=_LENGTH / 2))
    control = InteractiveMarkerControl(name="drag", always_visible=True, markers=[finger])
    control.interaction_mode = InteractiveMarkerControl.MOVE_3D
    return control
