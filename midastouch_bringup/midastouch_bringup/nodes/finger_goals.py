"""Places to which a person sends the finger of an explorer: where the object was clicked on, or its marker dropped."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from geometry_msgs.msg import PointStamped
from rclpy.node import Node

from midastouch_common import se3
from midastouch_common.message_arrays import point_from_msg
from midastouch_common.ros import qos

from ..explore.exploration import Exploration, Poses
from .explorer_control import Order

_FARTHEST = 3.0  # m from a frame's origin: beyond what an arm reaches, and the largest object


class FingerGoals:
    """Adds `clicked_point` to a node, the topic of RViz's tool *Publish Point*.

    take(order, reason): as of `ExplorerControl`. problem(kind, words): is told what cannot be.
    Args: frames, the names of `base` and `object`.
    """

    def __init__(
        self,
        node: Node,
        exploration: Exploration,
        frames: Mapping[str, str],
        take: Callable[[Order | None, str], str],
        problem: Callable[[str, str], None],
    ):
        self._did, self._frames, self._take, self._problem = exploration, frames, take, problem
        node.create_subscription(PointStamped, "clicked_point", self._on_click, qos.COMMAND)

    def send(self, point: np.ndarray, frame: str) -> None:
        """Let a person have the finger touch the surface next to a point (3,) m of a frame."""
        object_from = {
            self._frames["object"]: np.eye(4),
            self._frames["base"]: se3.inverse(self._did.world.base_from_object),
        }
        if frame not in object_from:
            why_not = f"it is in '{frame}'; choose {' or '.join(object_from)} as RViz's Fixed Frame"
        elif not (np.abs(point) <= _FARTHEST).all():
            why_not = f"no number may be beyond {_FARTHEST:g} m"
        else:
            place = (object_from[frame] @ [*point, 1.0])[:3]
            why_not = self._take(lambda: self._visit(place), "a person shows the finger where to touch")
        if why_not:
            self._problem("refused_places", f"nothing touches the place {_words(point)}: {why_not}")

    def _visit(self, place: np.ndarray) -> Poses:
        if not (yield from self._did.visit(place)):
            name = self._did.world.mesh.name
            self._problem(
                "out_of_reach", f"the finger cannot touch {name} at {_words(place)}: this is as near as it gets"
            )

    def _on_click(self, click: PointStamped) -> None:
        self.send(point_from_msg(click.point), click.header.frame_id)


def _words(point: np.ndarray) -> str:
    return f"({', '.join(f'{1e3 * each:.4g}' for each in point)}) mm"
