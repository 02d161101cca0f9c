"""Control of an explorer's finger by a person: services, single motions, and points to touch."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.message_arrays import point_from_msg
from midastouch_common.ros import qos
from midastouch_common.ros.addresses import load_mesh
from midastouch_common.ros.services import offer
from midastouch_msgs.msg import Suggestion
from midastouch_msgs.srv import SetObject

from ..exploration.acts import Plan
from ..exploration.exploration import Exploration
from .explorer_services import motion_of
from .explorer_sight import Sight

Order = Callable[[], Plan]


class ExplorerControl:
    """Services `~/pause`, `~/resume`, `~/push`, `~/lift` and `~/set_object`, and topic `~/move`, of a node.

    Attribute: commands: functions of the first four by name; each raises InputError if it is not possible.
    Args: take(order, reason): gives the finger to a person and carries out the order, if there is one, after the
    present motion; raises InputError if that is not possible. resume(): gives the finger back. push(): moves the
    object. change(request): replaces the object by that of a request.
    """

    def __init__(
        self,
        node: Node,
        exploration: Exploration,
        sight: Sight,
        take: Callable[[Order | None, str], None],
        resume: Callable[[], None],
        push: Order,
        change: Callable[[SetObject.Request], Plan],
    ):
        self._did, self._sight, self._take = exploration, sight, take
        self._do_push, self._change = push, change
        self._log = node.get_logger()
        self.commands = {"pause": self._pause, "resume": resume, "push": self._push, "lift": self._lift}
        for name, do in self.commands.items():
            offer(node, Trigger, f"~/{name}", partial(lambda do, _: do(), do))
        offer(node, SetObject, "~/set_object", self._on_set_object)
        node.create_subscription(Suggestion, "~/move", self._on_move, qos.COMMAND)

    def _pause(self) -> None:
        self._take(None, "a person has the finger; ~/resume lets it explore on")

    def _push(self) -> None:
        self._take(self._do_push, "a person has pushed the object")

    def _lift(self) -> None:
        self._take(lambda: self._did.leap(self._sight.of_filter()), "a person has lifted the finger")

    def _on_move(self, order: Suggestion) -> None:
        try:
            motion = motion_of(order)
            self._take(
                lambda: self._did.motions.carry_out(motion, self._sight.of_filter()), "a person moves the finger"
            )
        except InputError as error:
            self._log.warning(f"~/move: {error}")

    def _on_set_object(self, request: SetObject.Request) -> None:
        load_mesh(request.mesh_path)  # raises if it is none
        self._take(lambda: self._change(request), f"the object becomes {Path(request.mesh_path).stem}")


_FARTHEST_POINT_M = 3.0  # from a frame's origin: beyond what an arm reaches, and the largest object


class FingerGoals:
    """Subscription of a node to `clicked_point`, the topic of RViz's tool *Publish Point*.

    take(order, reason): as for `ExplorerControl`. problem(kind, words): called for a touch that is not possible.
    """

    def __init__(
        self,
        node: Node,
        exploration: Exploration,
        sight: Sight,
        take: Callable[[Order | None, str], None],
        problem: Callable[[str, str], None],
    ):
        self._did, self._sight, self._take, self._problem = exploration, sight, take, problem
        node.create_subscription(PointStamped, "clicked_point", self._on_click, qos.COMMAND)

    def send(self, point: np.ndarray, frame: str) -> None:
        """Take the finger for a person, and touch the surface next to a point (3,) m of a frame."""
        try:
            if not (np.abs(point) <= _FARTHEST_POINT_M).all():
                raise InputError(f"no number may be beyond {_FARTHEST_POINT_M:g} m")
            position = self._sight.in_base(point, frame)
            self._take(lambda: self._visit(position, point), "a person shows the finger where to touch")
        except InputError as error:
            self._problem("refused_places", f"nothing touches the place {_words(point)}: {error}")

    def _visit(self, position: np.ndarray, point: np.ndarray) -> Plan[None]:
        """Touch next to position (3,) m in the base frame; point (3,) m: the same, in the frame a person used."""
        if not (yield from self._did.motions.visit(position, self._sight.of_person())):
            name = self._sight.shown.name if self._sight.shown else "what is there"
            self._problem(
                "out_of_reach", f"the finger cannot touch {name} at {_words(point)}: this is as near as it gets"
            )

    def _on_click(self, click: PointStamped) -> None:
        self.send(point_from_msg(click.point), click.header.frame_id)


def _words(point: np.ndarray) -> str:
    return f"({', '.join(f'{1e3 * each:.4g}' for each in point)}) mm"
