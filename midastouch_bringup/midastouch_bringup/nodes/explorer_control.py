"""How a person takes the finger from an explorer: services, single motions, and points to touch."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.message_arrays import point_from_msg
from midastouch_common.ros import qos
from midastouch_msgs.msg import Suggestion
from midastouch_msgs.srv import SetObject

from ..explore.exploration import Exploration, Motion, Poses

Order = Callable[[], Poses]
_LONGEST_MOTION_M = 1.0


class ExplorerControl:
    """Adds `~/pause`, `~/resume`, `~/push`, `~/lift`, `~/set_object` and `~/move` to a node.

    Attributes: commands, what the first four do, by their names; each returns why it cannot be, else an empty text.
    take(order, reason): gives a person the finger, and lets it do what is ordered, if anything, after its present
    motion; returns why that cannot be, in words, else an empty text. resume(): gives it back. change(request): puts the
    object of a request there. load(address): its mesh, or InputError.
    """

    def __init__(
        self,
        node: Node,
        exploration: Exploration,
        take: Callable[[Order | None, str], str],
        resume: Callable[[], None],
        change: Callable[[SetObject.Request], Poses],
        load: Callable[[str], ObjectMesh],
    ):
        self._did, self._take, self._resume, self._change, self._load = exploration, take, resume, change, load
        self._log = node.get_logger()
        self.commands = {"pause": self._pause, "resume": self._go_on, "push": self._push, "lift": self._lift}
        for name, do in self.commands.items():
            node.create_service(Trigger, f"~/{name}", lambda _, response, do=do: _answer(response, do()))
        node.create_service(SetObject, "~/set_object", self._on_set_object)
        node.create_subscription(Suggestion, "~/move", self._on_move, qos.COMMAND)

    def _pause(self) -> str:
        return self._take(None, "a person has the finger; ~/resume lets it explore on")

    def _go_on(self) -> str:
        self._resume()
        return ""

    def _push(self) -> str:
        return self._take(self._did.world.push, "a person has pushed the object")

    def _lift(self) -> str:
        return self._take(lambda: self._did.obey(self._did.random_leap()), "a person has lifted the finger")

    def _on_move(self, order: Suggestion) -> None:
        numbers = order.heading, order.length
        if np.isfinite(numbers).all() and 0 <= order.length <= _LONGEST_MOTION_M:
            self._take(lambda: self._did.obey(motion_of(order)), "a person moves the finger")
        else:
            self._log.warning(f"~/move: heading and length are {numbers}; give rad, and 0 to {_LONGEST_MOTION_M:g} m")

    def _on_set_object(self, request: SetObject.Request, response: SetObject.Response) -> SetObject.Response:
        try:
            self._load(request.mesh_path)
        except InputError as error:
            return _answer(response, str(error))
        return _answer(response, self._take(lambda: self._change(request), f"the object becomes {request.mesh_path}"))


def motion_of(suggestion: Suggestion) -> Motion:
    """The motion that a message means."""
    return Motion(suggestion.heading, suggestion.length, suggestion.lift)


def _answer(response: Trigger.Response | SetObject.Response, why_not: str) -> Trigger.Response | SetObject.Response:
    response.success, response.message = not why_not, why_not
    return response


_FARTHEST_POINT_M = 3.0  # from a frame's origin: beyond what an arm reaches, and the largest object


class FingerGoals:
    """Adds `clicked_point` to a node, the topic of RViz's tool *Publish Point*.

    take(order, reason): as for `ExplorerControl`. problem(kind, words): called with what is not possible.
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
        elif not (np.abs(point) <= _FARTHEST_POINT_M).all():
            why_not = f"no number may be beyond {_FARTHEST_POINT_M:g} m"
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
