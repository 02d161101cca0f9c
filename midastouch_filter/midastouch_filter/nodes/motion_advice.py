"""Service and action `suggest_motion`, on where to touch next, and the topic `suggestions` that shows the answers."""

from __future__ import annotations

import math
from collections.abc import Callable

from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from midastouch_common.errors import InputError
from midastouch_common.ros import qos
from midastouch_common.ros.conversions import poses_to_msgs, stamp_from_ns
from midastouch_common.ros.goals import GoalServer, end_goal
from midastouch_common.ros.managed_node import INACTIVE
from midastouch_common.ros.parameters import Parameters
from midastouch_msgs import action
from midastouch_msgs.msg import Suggestion as SuggestionMsg
from midastouch_msgs.srv import SuggestMotion

from ..active_touch.suggestion import Advice, Suggestion, Wanted
from ..core.estimate import Estimate
from ..core.state import CONVERGED, NO_CONTACT
from ..localiser import Localiser
from . import markers

_LONGEST_WAY = 2.0  # m; no object is larger
_COUNT = 3  # suggestions, if a request does not say how many


class MotionAdvice:
    """Service and action for a node's localiser, None while the node is not active.

    A goal of the action is not executed until it ends: it waits for the next touch, and an executor would ask a waiting
    coroutine again and again. A dead client is not reported: its goals are kept until something ends them. They cost
    nothing as long as another client asks the same, because each question is answered once per frame. clock: returns
    seconds.
    """

    def __init__(
        self,
        node: Node,
        localiser: Callable[[], Localiser | None],
        parameters: Parameters,
        clock: Callable[[], float],
        stamp: Callable[[], int],
    ):
        self._localiser, self._parameters = localiser, parameters
        self._clock, self._stamp = clock, stamp
        self._goals: list[ServerGoalHandle] = []
        self._last = -math.inf
        self._of: Estimate | None = None
        self._answers: dict[Wanted, Advice] = {}  # on the estimate `_of`
        self._shown = node.create_publisher(MarkerArray, "suggestions", qos.stream_publisher(parameters["queue_depth"]))
        node.create_service(SuggestMotion, "suggest_motion", self._on_service)
        self._server = GoalServer(node, action.SuggestMotion, "suggest_motion", self._on_goal, self._on_cancel)

    def close(self) -> None:
        """Destroy the action server; this must precede the node's destruction, after which no goal could be ended."""
        self._goals = []
        self._server.close()

    def stop(self, reason: str) -> None:
        """End all goals, because the node stops being active."""
        for goal in self._goals:
            self._end(goal, False, reason)

    def changed(self, stamp: int) -> None:
        """Answer all goals again after the frame of `stamp` [ns], and end those that are reached."""
        rate, now = self._parameters["suggestion_rate"], self._clock()
        if not self._converged() and rate > 0 and now - self._last < 1.0 / rate:
            return
        self._last = now
        for goal in self._goals:
            self._answer(goal, stamp)

    def _converged(self) -> bool:
        return self._localiser().estimate.status.state == CONVERGED

    # --- the service

    def _on_service(self, request: SuggestMotion.Request, response: SuggestMotion.Response) -> SuggestMotion.Response:
        try:
            advice = self._advise(self._wanted(request))
        except InputError as error:
            response.message = str(error)
            return response
        response.success, response.message = True, advice.message
        response.indistinguishable, response.suggestions = (
            advice.indistinguishable,
            self._shown_as_messages(advice, self._stamp()),
        )
        return response

    # --- the action

    def _on_goal(self, goal: ServerGoalHandle) -> None:
        self._goals.append(goal)
        try:
            self._advise(self._wanted(goal.request))
        except InputError as error:
            self._end(goal, False, str(error))
            return
        self._answer(goal, self._stamp())

    def _on_cancel(self, goal: ServerGoalHandle) -> None:
        self._end(goal, False, "cancelled")

    def _answer(self, goal: ServerGoalHandle, stamp: int) -> None:
        try:
            advice = self._advise(self._wanted(goal.request))
        except InputError:  # the finger was lifted: wait for the next touch
            return
        header = Header(stamp=stamp_from_ns(stamp), frame_id=self._parameters["object_frame_id"])
        goal.publish_feedback(
            action.SuggestMotion.Feedback(header=header, suggestions=self._shown_as_messages(advice, stamp))
        )
        if advice.indistinguishable or self._converged():
            self._end(goal, True, advice.message, advice.indistinguishable)

    def _end(self, goal: ServerGoalHandle, success: bool, message: str, indistinguishable: bool = False) -> None:
        if goal not in self._goals:
            return
        self._goals = [each for each in self._goals if each is not goal]
        result = action.SuggestMotion.Result(success=success, message=message, indistinguishable=indistinguishable)
        end_goal(goal, success, result)

    # --- both

    def _wanted(self, request: SuggestMotion.Request | action.SuggestMotion.Goal) -> Wanted:
        """Return the request with defaults filled in; raises InputError if its length is out of range."""
        length = request.max_length
        if not 0 <= length <= _LONGEST_WAY:
            raise InputError(
                f"max_length {length:g} is not between 0 and {_LONGEST_WAY:g} m; 0 is the object's diagonal"
            )
        return Wanted(length or None, request.lifts, request.count or _COUNT)

    def _advise(self, wanted: Wanted) -> Advice:
        """Return the advice; raises InputError with the reason if there is none."""
        localiser = self._localiser()
        if localiser is None:
            raise InputError(INACTIVE)
        if localiser.filter is None:
            raise InputError(localiser.waiting_for)
        estimate = localiser.estimate
        if estimate is None or not estimate.modes:
            raise InputError("nothing was measured yet: touch the object first")
        if estimate.status.state == NO_CONTACT:
            raise InputError("the sensor touches nothing: touch the object first")
        if estimate.status.state == CONVERGED:
            return Advice([], False, f"nothing is left to find out: {estimate.status.reason}")
        if estimate is not self._of:
            self._of, self._answers = estimate, {}
        if wanted not in self._answers:
            self._answers[wanted] = localiser.advise(wanted)
        return self._answers[wanted]

    def _shown_as_messages(self, advice: Advice, stamp: int) -> list[SuggestionMsg]:
        header = Header(stamp=stamp_from_ns(stamp), frame_id=self._parameters["object_frame_id"])
        self._shown.publish(markers.suggested(advice.suggestions, header))
        return [_to_msg(each) for each in advice.suggestions]


def _to_msg(suggestion: Suggestion) -> SuggestionMsg:
    return SuggestionMsg(
        heading=suggestion.heading,
        length=suggestion.length,
        lift=suggestion.lift,
        information=suggestion.information,
        cost=suggestion.cost,
        reason=suggestion.reason,
        path=poses_to_msgs(suggestion.path),
    )
