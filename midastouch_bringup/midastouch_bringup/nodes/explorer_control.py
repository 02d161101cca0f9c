"""How a person takes the finger from an explorer: services, and a topic for single motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_common.ros import qos
from midastouch_msgs.msg import Suggestion
from midastouch_msgs.srv import SetObject

from ..explore.exploration import Exploration, Motion, Poses

Order = Callable[[], Poses]
_LONGEST = 1.0  # m


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
        if np.isfinite(numbers).all() and 0 <= order.length <= _LONGEST:
            self._take(lambda: self._did.obey(motion_of(order)), "a person moves the finger")
        else:
            self._log.warning(f"~/move: heading and length are {numbers}; give rad, and 0 to {_LONGEST:g} m")

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
