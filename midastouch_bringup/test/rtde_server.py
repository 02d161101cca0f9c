"""A UR controller's RTDE server, as a program: ur-rtde holds the interpreter while it connects, so that a server in
the same process could not answer it.

Protocol: Universal Robots, "Real-Time Data Exchange (RTDE) Guide". Big endian; every package is a header of
size (uint16, itself included) and type (one letter), then the payload.
"""

import contextlib
import socket
import struct
import sys
import time

TYPES = {
    "timestamp": "DOUBLE",
    "actual_TCP_pose": "VECTOR6D",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
}
POSE = [0.3, -0.2, 0.4, 0.1, 2.6, -0.2]
RECIPE = 1


def serve(client: socket.socket) -> None:
    """Answer one client's requests, then send it the state at 125 Hz."""
    names = []
    while header := _read(client, 3):
        size, letter = struct.unpack(">Hc", header)
        payload = _read(client, size - 3)
        if letter == b"V":
            _send(client, letter, bytes([payload == struct.pack(">H", 2)]))
        elif letter == b"v":
            _send(client, letter, struct.pack(">4I", 5, 12, 0, 1101))
        elif letter == b"O":
            print("frequency", struct.unpack(">d", payload[:8])[0], flush=True)
            names = payload[8:].decode().strip(",").split(",")
            types = ",".join(TYPES.get(name, "NOT_FOUND") for name in names)
            _send(client, letter, bytes([RECIPE]) + types.encode())
        elif letter == b"S":
            _send(client, letter, b"\x01")
            break
    start = time.monotonic()
    while names:
        time.sleep(0.008)
        now = 1000.0 + time.monotonic() - start
        values = {
            "timestamp": [now],
            "actual_TCP_pose": POSE,
            "actual_q": [0.1] * 6,
            "actual_qd": [0.2] * 6,
        }
        flat = [value for name in names for value in values[name]]
        _send(client, b"U", bytes([RECIPE]) + struct.pack(f">{len(flat)}d", *flat))


def _send(client: socket.socket, letter: bytes, payload: bytes) -> None:
    client.sendall(struct.pack(">Hc", 3 + len(payload), letter) + payload)


def _read(client: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size and (part := client.recv(size - len(data))):
        data += part
    return data


def main() -> None:
    """Serve one client after the other on the port in the first argument, until killed."""
    with socket.create_server(("127.0.0.1", int(sys.argv[1]))) as server:
        print("ready", flush=True)
        while True:
            client, _ = server.accept()
            with client, contextlib.suppress(OSError):  # one that is gone; the next may come
                serve(client)


if __name__ == "__main__":
    main()
