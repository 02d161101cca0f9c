"""The services of the filter node: nav2's two for a localiser, and `set_object`."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import Empty

from midastouch_msgs.srv import SetObject
from midastouch_perception.errors import InputError

from .localiser import Localiser


class FilterServices:
    """Offers them for a localiser. `change_object(mesh, codebook)` raises InputError if it leaves the old object."""

    def __init__(self, node: Node, localiser: Localiser, change_object: Callable[[str, str], None]):
        self._localiser, self._change_object = localiser, change_object
        node.create_service(Empty, "reinitialize_global_localization", self._on_reinitialize)
        node.create_service(Empty, "request_nomotion_update", self._on_nomotion_update)
        node.create_service(SetObject, "set_object", self._on_set_object)

    def _on_reinitialize(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        self._localiser.start_anywhere()
        return response

    def _on_nomotion_update(self, _: Empty.Request, response: Empty.Response) -> Empty.Response:
        if self._localiser.filter is not None:
            self._localiser.filter.force_update()
        return response

    def _on_set_object(self, request: SetObject.Request, response: SetObject.Response) -> SetObject.Response:
        try:
            self._change_object(request.mesh_path, request.codebook_path)
        except InputError as error:
            response.message = str(error)
        else:
            response.success = True
        return response
