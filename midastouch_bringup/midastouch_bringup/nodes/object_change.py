"""Another object under a simulated finger: in the simulator first, then the filter is told."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.task import Future

from midastouch_msgs.srv import SetObject


class ObjectChange:
    """Calls the two services `set_object`, one after the other, for a node that is spun.

    on_end(mesh_path, why_not) is called after each change, with an empty text if both have taken the object. `pending`:
    whether one is going on.
    """

    def __init__(self, node: Node, on_end: Callable[[str, str], None]):
        self._on_end, self.pending = on_end, False
        self._services = [node.create_client(SetObject, name) for name in ("digit_sim/set_object", "set_object")]

    def begin(self, request: SetObject.Request) -> None:
        """Change the object to the mesh of a request."""
        self.pending = True
        self._call(request, 0)

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
