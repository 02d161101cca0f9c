"""Services whose response holds `success` and `message`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from ..errors import InputError


def offer(node: Node, kind: type, name: str, do: Callable[[Any], str | None]) -> None:
    """Offer a service of a node.

    do(request) carries a request out and returns the message, if there is one. The text of an InputError is the message
    of a request that is refused.
    """

    def answer(request: Any, response: Any) -> Any:
        try:
            response.message, response.success = do(request) or "", True
        except InputError as error:
            response.message = str(error)
        return response

    node.create_service(kind, name, answer)
