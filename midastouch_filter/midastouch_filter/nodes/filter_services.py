"""The services of the filter node: nav2's two for a localiser, and `set_object`."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import Empty

from midastouch_common.errors import InputError
from midastouch_msgs.srv import SetObject

from ..localiser import Localiser

_INACTIVE = "the node is not active; activate it (ros2 lifecycle set)"


class FilterServices:
    """Offers them for a node's localiser, None while the node is not active, which is said to whoever asks then.

    `change_object(mesh, codebook)` raises InputError if it leaves the old object.
    """

    def __init__(
        self, node: Node, localiser: Callable[[], Localiser | None], change_object: Callable[[str, str], None]
    ):
        self._log, self._localiser, self._change_object = node.get_logger(), localiser, change_object
        node.create_service(Empty, "reinitialize_global_localization", self._on_reinitialize)
        node.create_service(Empty, "request_nomotion_update", self._on_nomotion_update)
        node.create_service(SetObject, "set_object", self._on_set_object)

    def _on_reinitialize(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        if (localiser := self._active("reinitialize_global_localization")) is not None:
            localiser.start_anywhere()
        return response

    def _on_nomotion_update(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        localiser = self._active("request_nomotion_update")
        if localiser is not None and localiser.filter is not None:
            localiser.filter.force_update()
        return response

    def _on_set_object(self, request: SetObject.Request, response: SetObject.Response) -> SetObject.Response:
        if self._active("set_object") is None:
            response.message = _INACTIVE
            return response
        try:
            self._change_object(request.mesh_path, request.codebook_path)
        except InputError as error:
            response.message = str(error)
        else:
            response.success = True
        return response

    def _active(self, service: str) -> Localiser | None:
        localiser = self._localiser()
        if localiser is None:
            self._log.warning(f"{service}: {_INACTIVE}")
        return localiser
