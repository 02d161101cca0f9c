"""Services that an explorer calls: where to touch next, and what a person does to a simulated object."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from midastouch_filter.active_touch.suggestion import Advice, Suggestion
from midastouch_msgs.srv import SetObject, SuggestMotion

from ..explore.acts import Plan

TIMEOUT_S = 10.0
"""s until an answer, which takes a tenth of one, is given up."""


def advice_of(response: SuggestMotion.Response) -> Advice:
    """What a response of `suggest_motion` says, but for the paths."""
    names = "heading", "length", "lift", "information", "cost", "reason"
    suggestions = [
        Suggestion(**{name: getattr(each, name) for name in names}, path=np.zeros((0, 4, 4)))
        for each in response.suggestions
    ]
    return Advice(suggestions, response.indistinguishable, response.message)


class QuestionClient:
    """Asks a service one question at a time. on_answer: called with each response; in place of one that is overdue with
    one that says so in its `message`, and nothing else."""

    def __init__(self, node: Node, kind: type, name: str, on_answer: Callable[[Any], None]):
        self._client, self._kind = node.create_client(kind, name), kind
        self._on_answer = on_answer
        self._asked_at, self._future = 0.0, None

    @property
    def ready(self) -> bool:
        """Whether somebody offers the service."""
        return self._client.service_is_ready()

    @property
    def pending(self) -> bool:
        """Whether an answer is still to come."""
        return self._future is not None

    def ask(self, request: Any) -> None:
        """Send the question."""
        self._asked_at = time.monotonic()
        self._future = self._client.call_async(request)
        self._future.add_done_callback(self._on_done)

    def look(self) -> None:
        """Give up waiting for an answer that is overdue; call this regularly."""
        if self.pending and time.monotonic() - self._asked_at > TIMEOUT_S:
            self._client.remove_pending_request(self._future)
            self._future = None
            self._on_answer(self._kind.Response(message=f"no answer for {TIMEOUT_S:g} s"))

    def _on_done(self, future: Future) -> None:
        if future is self._future:  # else it comes too late
            self._future = None
            self._on_answer(future.result())


class ObjectChange:
    """Calls the services `set_object` of finger, sensor and filter, one after the other, for a node that is spun.

    on_end(mesh_path, why_not) is called after each change, with an empty text if all have taken the object. `pending`:
    whether one is going on.
    """

    def __init__(self, node: Node, on_end: Callable[[str, str], None]):
        self._on_end, self.pending = on_end, False
        # the filter last: it begins anew with images of the new object
        names = "finger/set_object", "digit_sim/set_object", "set_object"
        self._services = [node.create_client(SetObject, name) for name in names]

    def __call__(self, request: SetObject.Request) -> Plan[None]:
        """Change the object to the mesh of a request."""
        self.pending = True
        self._call(request, 0)
        yield from ()

    def _call(self, request: SetObject.Request, number: int) -> None:
        service = self._services[number]
        if not service.service_is_ready():
            self._end(request, f"nobody offers {service.srv_name}")
            return
        service.call_async(request).add_done_callback(lambda future: self._on_answer(request, number, future))

    def _on_answer(self, request: SetObject.Request, number: int, future: Future) -> None:
        response: SetObject.Response = future.result()
        if not response.success:
            self._end(request, response.message)
        elif number + 1 < len(self._services):
            self._call(request, number + 1)
        else:
            self._end(request, "")

    def _end(self, request: SetObject.Request, why_not: str) -> None:
        self.pending = False
        self._on_end(request.mesh_path, why_not)


class Push:
    """Calls `finger/push`, which moves a simulated object. problem(kind, words): is told what is not possible."""

    def __init__(self, node: Node, problem: Callable[[str, str], None]):
        self._client, self._problem = node.create_client(Trigger, "finger/push"), problem

    def __call__(self) -> Plan[None]:
        """The finger does it before whatever it is asked for next."""
        if self._client.service_is_ready():
            self._client.call_async(Trigger.Request())
        else:
            self._problem("refused_pushes", "nobody offers finger/push: the object is none of a simulation")
        yield from ()
