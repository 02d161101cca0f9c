"""The finger as an interactive marker, which you drag to where it should touch."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from geometry_msgs.msg import Point, Pose, Vector3
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import ColorRGBA, Header
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

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import point_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import pose_to_msg

from .explorer_sight import Sight

_NAME = "finger"
_RATE = 10.0  # Hz; the eye sees a motion
_DIAMETER, _LENGTH = 0.01, 0.03  # m
_COLOUR = ColorRGBA(r=1.0, g=0.7, b=0.1, a=0.8)


class FingerMarker:
    """The gel of an arm on `~/finger/...`, in the protocol of ROS 2's package `interactive_markers`.

    A viewer asks the service `get_interactive_markers` for all markers, then follows `update`, whose messages are
    numbered without a gap, and reports on `feedback` what its user does. It asks again if a number is missing or the
    service was gone, so no keep-alive messages are needed. While its user drags, it holds updates back by itself.

    Args: sight: pose of the gel; send(point, frame): makes the finger touch there; menu: function of each entry, which
    raises InputError if it is not possible; problem(kind, words): called for a feedback that is refused.
    """

    def __init__(
        self,
        node: Node,
        sight: Sight,
        send: Callable[[np.ndarray, str], None],
        menu: Mapping[str, Callable[[], None]],
        problem: Callable[[str, str], None],
    ):
        self._sight, self._send, self._problem = sight, send, problem
        self._menu = dict(enumerate(menu.items(), start=1))  # 0 is no entry
        self._server = node.get_fully_qualified_name()
        self._header = Header(frame_id=sight.base)  # without a stamp: the marker is fixed in the frame
        self._number, self._shown = 0, np.zeros((4, 4))
        self._grasped: tuple[str, np.ndarray] | None = None  # by which viewer, and where
        node.create_service(GetInteractiveMarkers, "~/finger/get_interactive_markers", self._on_request)
        self._updates = node.create_publisher(InteractiveMarkerUpdate, "~/finger/update", qos.INTERACTIVE_MARKERS)
        node.create_subscription(
            InteractiveMarkerFeedback, "~/finger/feedback", self._on_feedback, qos.INTERACTIVE_MARKERS
        )
        node.create_timer(1 / _RATE, self._follow, clock=Clock(clock_type=ClockType.STEADY_TIME))

    # --- to viewers

    def _on_request(self, _, response: GetInteractiveMarkers.Response) -> GetInteractiveMarkers.Response:
        entries = [MenuEntry(id=key, title=title) for key, (title, _) in self._menu.items()]
        pose = pose_to_msg(self._sight.gel)
        response.sequence_number = self._number
        response.markers = [
            InteractiveMarker(
                header=self._header, name=_NAME, pose=pose, scale=_LENGTH, menu_entries=entries, controls=[_control()]
            )
        ]
        return response

    def _follow(self) -> None:
        """Publish the pose of the finger if it differs from the last one sent."""
        pose = self._sight.gel
        if np.array_equal(pose, self._shown) or not self._updates.get_subscription_count():
            return
        self._shown, self._number = pose, self._number + 1
        moved = InteractiveMarkerPose(header=self._header, name=_NAME, pose=pose_to_msg(pose))
        update = InteractiveMarkerUpdate.UPDATE
        self._updates.publish(
            InteractiveMarkerUpdate(server_id=self._server, seq_num=self._number, type=update, poses=[moved])
        )

    # --- from viewers

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
            self._shown = np.zeros((4, 4))  # to send it again: the viewer leaves it where it was dropped
            self._send(position, did.header.frame_id)

    def _choose(self, did: InteractiveMarkerFeedback) -> None:
        title, do = self._menu.get(did.menu_entry_id, ("", None))
        if do is None:
            self._refuse(did, f"the menu has no entry {did.menu_entry_id}")
            return
        try:
            do()
        except InputError as error:
            self._refuse(did, f"{title}: {error}")

    def _refuse(self, did: InteractiveMarkerFeedback, why: str) -> None:
        self._problem("refused_feedback", f"~/finger/feedback of '{did.client_id}': {why}")


def _control() -> InteractiveMarkerControl:
    """Make the part to grasp: a finger that stands on the surface and is dragged relative to the camera's view."""
    finger = Marker(type=Marker.CYLINDER, scale=Vector3(x=_DIAMETER, y=_DIAMETER, z=_LENGTH), color=_COLOUR)
    finger.pose = Pose(position=Point(z=_LENGTH / 2))
    control = InteractiveMarkerControl(name="drag", always_visible=True, markers=[finger])
    control.interaction_mode = InteractiveMarkerControl.MOVE_3D
    return control
