"""Services that an explorer asks: where to touch next, what the arm reaches, another object."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray
from rclpy.exceptions import InvalidServiceNameException
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_common.ros.conversions import pose_to_msg
from midastouch_filter.active_touch.suggestion import Advice, Suggestion
from midastouch_msgs import srv
from midastouch_msgs.msg import Suggestion as SuggestionMsg
from midastouch_msgs.srv import SetObject, SuggestMotion

from ..exploration.acts import CheckReach, Plan
from ..exploration.motions import Motion

TIMEOUT_S = 10.0
"""s until an answer, which takes a tenth of a second, is given up."""
OBJECT_TIMEOUT_S = 120.0
"""s until a change of the object is given up; a codebook may have to be built for it."""
_SUGGESTIONS = 24  # asked for: all that are offered
_LONGEST_M = 1.0  # m, of a motion that is asked for


def motion_of(message: SuggestionMsg) -> Motion:
    """Return the motion of a suggestion or an order; InputError for numbers that make no motion."""
    numbers = message.heading, message.length
    if not (np.isfinite(numbers).all() and 0 <= message.length <= _LONGEST_M):
        raise InputError(f"heading and length are {numbers}; give rad, and 0 to {_LONGEST_M:g} m")
    return Motion(message.heading, message.length, message.lift)


def advice_of(response: SuggestMotion.Response) -> Advice:
    """Return the advice of a `suggest_motion` response, without paths; InputError for none, and for invalid motions."""
    if not response.success:
        raise InputError(response.message)
    names = "heading", "length", "lift", "information", "cost", "reason"
    for each in response.suggestions:
        motion_of(each)
        if not np.isfinite(each.information):
            raise InputError(f"a suggestion's information is {each.information}")
    suggestions = [
        Suggestion(**{name: getattr(each, name) for name in names}, path=np.zeros((0, 4, 4)))
        for each in response.suggestions
    ]
    return Advice(suggestions, response.indistinguishable, response.message)


class QuestionClient:
    """Client that asks a service one question at a time. on_answer: called with each response; if none comes within
    timeout() [s], with an empty one whose `message` says so. Attribute: name: of the service."""

    def __init__(
        self,
        node: Node,
        kind: type[Any],
        name: str,
        on_answer: Callable[[Any], None],
        timeout: Callable[[], float] = lambda: TIMEOUT_S,
    ):
        self.name, self._client, self._kind = name, node.create_client(kind, name), kind
        self._on_answer, self._timeout = on_answer, timeout
        self._asked_at = 0.0
        self._future: Future | None = None

    @property
    def ready(self) -> bool:
        """True while the service is offered."""
        return self._client.service_is_ready()

    @property
    def pending(self) -> bool:
        """True while an answer is still to come."""
        return self._future is not None

    def ask(self, request: Any) -> None:
        """Send the question."""
        self._asked_at = time.monotonic()
        self._future = self._client.call_async(request)
        self._future.add_done_callback(self._on_done)

    def look(self) -> None:
        """Give up waiting for an answer that is overdue; call this regularly."""
        if self.pending and time.monotonic() - self._asked_at > self._timeout():
            self._client.remove_pending_request(self._future)
            self._future = None
            self._on_answer(self._kind.Response(message=f"no answer for {self._timeout():g} s"))

    def _on_done(self, future: Future) -> None:
        if future is self._future:  # else it comes too late
            self._future = None
            self._on_answer(future.result())


class AdviceClient(QuestionClient):
    """Client of `suggest_motion`. longest [m]: of a motion; on_advice(advice, why_not): called with each answer, with
    None and the reason if there is no advice."""

    def __init__(self, node: Node, longest: float, on_advice: Callable[[Advice | None, str], None]):
        super().__init__(node, SuggestMotion, "suggest_motion", self._on_response)
        self._longest, self._on_advice = longest, on_advice

    def ask_where(self) -> None:
        """Ask where to touch next."""
        self.ask(SuggestMotion.Request(max_length=self._longest, lifts=True, count=_SUGGESTIONS))

    def _on_response(self, response: SuggestMotion.Response) -> None:
        try:
            advice, why_not = advice_of(response), ""
        except InputError as error:
            advice, why_not = None, str(error)
        self._on_advice(advice, why_not)


class ObjectChange:
    """Client of `set_object` of finger, sensor and filter, called one after the other while the node is spun.

    on_end(mesh_path, why_not) is called after each change, with an empty text if all have taken the object. `pending`:
    True while a change is under way.
    """

    def __init__(self, node: Node, on_end: Callable[[str, str], None]):
        self._on_end, self.pending = on_end, False
        # the filter last: it starts again with images of the new object
        names = "simulated_finger/set_object", "digit_sim/set_object", "set_object"
        self._services = [
            QuestionClient(node, SetObject, name, self._on_answer, lambda: OBJECT_TIMEOUT_S) for name in names
        ]

    def __call__(self, request: SetObject.Request) -> Plan[None]:
        """Change the object to the mesh of a request."""
        self.pending, self._request, self._number = True, request, -1
        self._next()
        yield from ()

    def look(self) -> None:
        """Give up waiting, as `QuestionClient` does; call this regularly."""
        for service in self._services:
            service.look()

    def _next(self) -> None:
        self._number += 1
        if self._number == len(self._services):
            self._end("")
        elif self._services[self._number].ready:
            self._services[self._number].ask(self._request)
        else:
            self._end(f"no node offers {self._services[self._number].name}")

    def _on_answer(self, response: SetObject.Response) -> None:
        if response.success:
            self._next()
        else:
            self._end(f"{self._services[self._number].name}: {response.message}")

    def _end(self, why_not: str) -> None:
        self.pending = False
        self._on_end(self._request.mesh_path, why_not)


class Push:
    """Client of `simulated_finger/push`, which moves a simulated object. problem(kind, words): called if it cannot."""

    def __init__(self, node: Node, problem: Callable[[str, str], None]):
        self._client, self._problem = node.create_client(Trigger, "simulated_finger/push"), problem

    def __call__(self) -> Plan[None]:
        """Ask for the push, which the finger makes before its next motion."""
        if self._client.service_is_ready():
            self._client.call_async(Trigger.Request())
        else:
            self._problem("refused_pushes", "no node offers simulated_finger/push: the object is not simulated")
        yield from ()


class ReachClient:
    """Client that asks one question at a time. on_answer(reached, why_not) is called for each, also if no answer came.
    problem(kind, words): called if the poses are not reached.

    Args: service: its name, empty if there is none and nothing will be asked; base: name of the base frame. Raises
    InputError if `service` is no name of a service.
    """

    def __init__(
        self,
        node: Node,
        service: str,
        base: str,
        on_answer: Callable[[bool, str], None],
        problem: Callable[[str, str], None],
    ):
        self._service, self._base, self._on_answer, self._problem = service, base, on_answer, problem
        self._asked, self._failure = 0, ""
        try:
            self._client = QuestionClient(node, srv.CheckReach, service, self._on_response) if service else None
        except InvalidServiceNameException as error:
            raise InputError(f"explorer: parameter reach_service: {' '.join(str(error).split())}") from error

    @property
    def trouble(self) -> str:
        """Reason in words why a question would not be answered, or the last one was not; empty if none is known."""
        offered = self._client is None or self._client.ready
        return self._failure if offered else self._unanswered("no node offers it")

    def ask(self, question: CheckReach) -> None:
        """Send the question; if the service is not offered, `look` answers it."""
        self._asked = len(question.poses)
        if self._client.ready:
            poses = PoseArray(header=Header(frame_id=self._base), poses=[pose_to_msg(each) for each in question.poses])
            self._client.ask(srv.CheckReach.Request(poses=poses))

    def look(self) -> None:
        """Give up waiting for an answer that is overdue, or that no service will give; call this regularly."""
        if self._asked and not self._client.pending:
            self._on_response(srv.CheckReach.Response(message="no node offers it"))
        elif self._asked:
            self._client.look()

    def _on_response(self, response: srv.CheckReach.Response) -> None:
        asked, self._asked = self._asked, 0
        if len(response.reachable) == asked:
            self._failure = ""
            reached = all(response.reachable)
            why_not = f"{self._service} says that the arm does not reach it: {response.message or 'no reason given'}"
        else:
            words = f"{len(response.reachable)} answers for {asked} poses"
            why_not = self._failure = self._unanswered(f"{response.message}, {words}" if response.message else words)
            reached = False
        if not reached:
            self._problem("out_of_reach", why_not)
        self._on_answer(reached, why_not)

    def _unanswered(self, why: str) -> str:
        return f"reach_service {self._service}: {why}"
