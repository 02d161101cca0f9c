"""The handshake of RTDE (Universal Robots, "Real-Time Data Exchange Guide"), before `ur-rtde` makes its own.

If nothing answers, `ur-rtde` waits for minutes without releasing the interpreter; if a controller refuses, it ends the
whole process.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence

_PROTOCOL = 2
_VERSION, _RECIPE, _START, _TEXT = b"V", b"O", b"S", b"M"
_YES = b"\x01"


def require_outputs(address: str, port: int, outputs: Sequence[str], rate: float, timeout: float) -> None:
    """Raise ConnectionError, with the reason, unless a controller answers that would send these outputs.

    rate: samples per second; timeout [s] of each answer.
    """
    try:
        with socket.create_connection((address, port), timeout=timeout) as connection:
            _negotiate(connection, outputs, rate)
    except OSError as error:
        raise ConnectionError(f"no RTDE at {address}:{port}: {error}") from error


def _negotiate(connection: socket.socket, outputs: Sequence[str], rate: float) -> None:
    if _ask(connection, _VERSION, struct.pack(">H", _PROTOCOL)) != _YES:
        raise ConnectionError(f"it refuses protocol {_PROTOCOL}; update the controller's software")
    answer = _ask(connection, _RECIPE, struct.pack(">d", rate) + ",".join(outputs).encode())
    # one byte names the recipe; the rest are the outputs' types
    types = answer[1:].decode("ascii", "replace").split(",")
    missing = [name for name, kind in zip(outputs, types, strict=False) if kind in ("NOT_FOUND", "IN_USE")]
    if missing or len(types) != len(outputs):
        raise ConnectionError(f"it does not give {', '.join(missing or outputs)}; update the controller's software")
    if _ask(connection, _START, b"") != _YES:
        raise ConnectionError("it refuses to start sending; is its program being loaded?")


def _ask(connection: socket.socket, letter: bytes, payload: bytes) -> bytes:
    """Return the payload of the answer to a request; text messages that come in between are ignored."""
    connection.sendall(struct.pack(">Hc", 3 + len(payload), letter) + payload)
    while True:
        size, answered = struct.unpack(">Hc", _read(connection, 3))
        if answered not in (letter, _TEXT) or size < 3:
            raise ConnectionError("what answers does not speak RTDE")
        answer = _read(connection, size - 3)
        if answered == letter:
            return answer


def _read(connection: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            raise ConnectionError("it closed the connection")
        data += part
    return data
