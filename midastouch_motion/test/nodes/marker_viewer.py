"""A viewer of interactive markers that does what RViz is recorded to do."""

from pathlib import Path

import yaml
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerUpdate
from visualization_msgs.srv import GetInteractiveMarkers

from midastouch_common.message_arrays import pose_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import pose_to_msg

FACTS = yaml.safe_load((Path(__file__).parents[3] / "tests" / "facts" / "interactive_markers.yaml").read_text())
FINGER = "explorer/finger"


class Viewer:
    """Attributes: marker and number, as asked for; pose, T_base_gel (4, 4), the newest; numbers and kinds of
    updates."""

    def __init__(self, graph, name="rviz"):
        self.graph, self.name, self.numbers, self.kinds = graph, name, [], []
        graph.companion.create_subscription(
            InteractiveMarkerUpdate, f"{FINGER}/update", self._on_update, qos.INTERACTIVE_MARKERS
        )
        self._feedback = graph.publisher(InteractiveMarkerFeedback, f"{FINGER}/feedback", qos.INTERACTIVE_MARKERS)
        self.ask()

    def ask(self):
        name, request = f"{FINGER}/get_interactive_markers", GetInteractiveMarkers.Request()
        response = self.graph.call(GetInteractiveMarkers, name, request)
        (self.marker,) = response.markers
        self.number, self.pose = response.sequence_number, pose_from_msg(self.marker.pose)

    def _on_update(self, update):
        self.numbers.append(update.seq_num)
        self.kinds.append(update.type)
        (pose,) = update.poses
        self.pose = pose_from_msg(pose.pose)

    def feed(self, event, position, **fields):
        """One message on `feedback`."""
        pose = self.pose.copy()
        pose[:3, 3] = position
        fields = {"marker_name": self.marker.name, "client_id": self.name, "control_name": "drag", **fields}
        kind = getattr(InteractiveMarkerFeedback, event)
        did = InteractiveMarkerFeedback(header=self.marker.header, event_type=kind, **fields)
        did.pose = pose_to_msg(pose)
        self._feedback.publish(did)

    def does(self, what, position, **fields):
        """What RViz says while its user does that."""
        for event in FACTS["feedback"][what]:
            self.feed(event, position, **fields)

    def drag(self, position):
        start = self.pose[:3, 3]
        self.does("press", start)
        for share in (0.3, 0.7, 1.0):
            self.does("drag", start + share * (position - start))
        self.does("release", position)

    def choose(self, title):
        (entry,) = (one for one in self.marker.menu_entries if one.title == title)
        self.does("menu", self.pose[:3, 3], menu_entry_id=entry.id)
