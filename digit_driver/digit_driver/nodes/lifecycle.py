"""A lifecycle node that survives being asked for an impossible transition."""

from __future__ import annotations

from lifecycle_msgs.srv import ChangeState
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode

RCLError = rclpy_implementation.RCLError
"""What rclpy raises when the layer below refuses; it has no public name."""


class RobustLifecycleNode(LifecycleNode):
    """Answers an impossible transition with ``success: false``.

    rclpy lets that request raise out of the executor, so that any client could end the process.
    """

    def __init__(self, name: str, **kwargs) -> None:
        super().__init__(name, **kwargs)
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._change_state_or_refuse

    @property
    def lifecycle_state(self) -> str:
        """Label of the current state, e.g. ``active``."""
        return self._state_machine.current_state[1]

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
