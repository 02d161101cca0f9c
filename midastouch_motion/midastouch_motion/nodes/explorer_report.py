"""Reports of an explorer: its status, the object that is really there, and diagnostics."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from midastouch_common.mesh import ObjectMesh
from midastouch_common.ros import diagnostics, qos
from midastouch_common.ros.conversions import stamp_from_ns
from midastouch_filter.nodes.markers import object_mesh
from midastouch_msgs.msg import ExplorerStatus

from ..exploration.exploration import Exploration

_LAST_WORD_S = 2.0


class ExplorerReport:
    """Reports of an explorer. Attributes: state, reason: as in `ExplorerStatus`; stamp [ns]: of the newest image that
    the filter has answered.

    Args: base, object_: names of frames.
    """

    def __init__(self, node: Node, exploration: Exploration, base: str, object_: str):
        self._did, self._base, self._object, self.stamp = exploration, base, object_, 0
        self._log = node.get_logger()
        self._status = node.create_publisher(ExplorerStatus, "~/status", qos.latched())
        self._mesh = node.create_publisher(MarkerArray, "~/object_mesh", qos.latched())
        self._diagnostics = diagnostics.Diagnostics(node, self._describe)
        self.say(
            ExplorerStatus.STATE_WAITING, "for an arm, the filter's first answer, and reach_service if there is one"
        )

    @property
    def over(self) -> bool:
        """True once the exploration has ended."""
        return self.state in (ExplorerStatus.STATE_KNOWN, ExplorerStatus.STATE_GAVE_UP)

    def say(self, state: str, reason: str) -> None:
        """Change state and reason; log and publish them."""
        self.state, self.reason = state, reason
        self._log.info(f"{state}: {reason}")
        self.tell()

    def tell(self) -> None:
        """Publish state and reason again, with the present path and motions."""
        header = Header(stamp=stamp_from_ns(self.stamp), frame_id=self._base)
        status = ExplorerStatus(header=header, state=self.state, reason=self.reason)
        did = self._did.motions
        status.path_length, status.slides, status.lifts = did.path, did.slides, did.lifts
        self._status.publish(status)

    def end(self, known: bool, words: str) -> None:
        """Publish the final state; the process may end once this returns."""
        self.say(ExplorerStatus.STATE_KNOWN if known else ExplorerStatus.STATE_GAVE_UP, words)
        self._status.wait_for_all_acked(Duration(seconds=_LAST_WORD_S))

    def problem(self, name: str, words: str) -> None:
        """Count a problem."""
        self._diagnostics.problem(name, words)

    def show_object(self, mesh: ObjectMesh) -> None:
        """Publish the mesh that is really there, in its frame; the filter publishes the one that it believes in."""
        self._mesh.publish(object_mesh(mesh.path.resolve().as_uri(), Header(frame_id=self._object)))

    def _describe(self) -> tuple[bytes, str, dict]:
        level = diagnostics.ERROR if self.state == ExplorerStatus.STATE_GAVE_UP else diagnostics.OK
        did = self._did.motions
        values = {"path_m": f"{did.path:.3f}", "slides": did.slides, "lifts": did.lifts}
        return level, f"{self.state}: {self.reason}", values
