"""Client of a user's service that answers which poses the arm reaches."""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import PoseArray
from rclpy.exceptions import InvalidServiceNameException
from rclpy.node import Node
from std_msgs.msg import Header

from midastouch_common.errors import InputError
from midastouch_common.ros.conversions import pose_to_msg
from midastouch_msgs import srv

from ..exploration.acts import CheckReach
from .explorer_services import QuestionClient


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
        return self._failure if offered else self._unanswered("nobody offers it")

    def ask(self, question: CheckReach) -> None:
        """Send the question; if the service is not offered, `look` answers it."""
        self._asked = len(question.poses)
        if self._client.ready:
            poses = PoseArray(header=Header(frame_id=self._base), poses=[pose_to_msg(each) for each in question.poses])
            self._client.ask(srv.CheckReach.Request(poses=poses))

    def look(self) -> None:
        """Give up waiting for an answer that is overdue, or that no service will give; call this regularly."""
        if self._asked and not self._client.pending:
            self._on_response(srv.CheckReach.Response(message="nobody offers it"))
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
