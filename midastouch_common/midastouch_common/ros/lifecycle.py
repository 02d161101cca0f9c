"""A lifecycle node that survives being asked for an impossible transition, and says why a transition failed."""

from __future__ import annotations

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

RCLError = rclpy_implementation.RCLError
"""What rclpy raises when the layer below refuses; it has no public name."""


class RobustLifecycleNode(LifecycleNode):
    """Answers an impossible transition with ``success: false``.

    rclpy lets that request raise out of the executor, so that any client could end the process.
    """

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self.failure = ""
        """Why the last transition failed or the node gave up; empty while it works or tries to."""
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._change_state_or_refuse

    @property
    def lifecycle_state(self) -> str:
        """Label of the current state, e.g. ``active``."""
        return self._state_machine.current_state[1]

    def start(self) -> bool:
        """Configures and activates, as a lifecycle manager does; whether both succeeded."""
        transitions = self.trigger_configure, self.trigger_activate
        return all(transition() is TransitionCallbackReturn.SUCCESS for transition in transitions)

    def give_up(self, reason: str) -> TransitionCallbackReturn:
        """Keeps and logs why a transition fails."""
        self.failure = reason
        self.get_logger().error(reason)
        return TransitionCallbackReturn.FAILURE

    def destroy_node(self) -> None:
        """As rclpy's, and the state machine, which else keeps the node below it visible until it is collected."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()

    def _change_state_or_refuse(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        try:
            return self._change_state(request, response)
        except RCLError:
            wanted = request.transition.label or f"transition {request.transition.id}"
            self.get_logger().warning(f"{wanted} is not possible while {self.lifecycle_state}")
            response.success = False
            return response
