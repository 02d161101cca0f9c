"""A UR controller's RTDE server, as a program: ur-rtde holds the interpreter while it connects, so that a server in
the same process could not answer it.

Protocol: Universal Robots, "Real-Time Data Exchange (RTDE) Guide". Big endian; every package is a header of
size (uint16, itself included) and type (one letter), then the payload.
"""

import contextlib
import itertools
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
PERIOD = 0.008
# Packages. ur-rtde returns from its constructor up to 0.55 s after the start: a connection shorter than that would
# never be seen alive.
FAULTY_AFTER = 125
FAULTS = ("old protocol", "unknown output", "refused start", "drop", "cut", "stall", "bursts")


def serve(client: socket.socket, fault: str) -> None:
    """Answer one client's requests, then send it the state at 125 Hz, until its connection fails as `fault` says.

    The first joint's angle is the time of the state, so that a reader can tell when each one was measured.
    """
    names = []
    while header := _read(client, 3):
        size, letter = struct.unpack(">Hc", header)
        payload = _read(client, size - 3)
        if letter == b"V":
            _send(client, letter, bytes([payload == struct.pack(">H", 2) and fault != "old protocol"]))
        elif letter == b"v":
            _send(client, letter, struct.pack(">4I", 5, 12, 0, 1101))
        elif letter == b"O":
            print("frequency", struct.unpack(">d", payload[:8])[0], flush=True)
            names = payload[8:].decode().strip(",").split(",")
            known = {} if fault == "unknown output" else TYPES
            types = ",".join(known.get(name, "NOT_FOUND") for name in names)
            _send(client, letter, bytes([RECIPE]) + types.encode())
        elif letter == b"S":
            _send(client, letter, bytes([fault != "refused start"]))
            break
    start = time.monotonic()
    held = b""
    for number in itertools.count():
        time.sleep(PERIOD)
        held += _package(names, 1000.0 + time.monotonic() - start)
        if fault == "bursts" and number % 40 < 25:
            continue  # on its way for 200 ms, then all at once
        if number == FAULTY_AFTER and fault in ("drop", "cut"):
            client.sendall(held[: len(held) // 2] if fault == "cut" else b"")
            return
        if number > FAULTY_AFTER and fault == "stall":
            client.recv(1)  # until the client has had enough
            return
        client.sendall(held)
        held = b""


def _package(names: list[str], now: float) -> bytes:
    values = {"timestamp": [now], "actual_TCP_pose": POSE, "actual_q": [now] + [0.1] * 5, "actual_qd": [0.2] * 6}
    flat = [value for name in names for value in values[name]]
    payload = bytes([RECIPE]) + struct.pack(f">{len(flat)}d", *flat)
    return struct.pack(">Hc", 3 + len(payload), b"U") + payload


def _send(client: socket.socket, letter: bytes, payload: bytes) -> None:
    client.sendall(struct.pack(">Hc", 3 + len(payload), letter) + payload)


def _read(client: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size and (part := client.recv(size - len(data))):
        data += part
    return data


def main() -> None:
    """Serve one client after the other on the given address and port, until killed; the third argument is a fault."""
    address, port, fault = sys.argv[1:]
    with socket.create_server((address, int(port))) as server:
        print("ready", flush=True)
        while True:
            client, _ = server.accept()
            with client, contextlib.suppress(OSError):  # one that is gone; the next may come
                serve(client, fault)


if __name__ == "__main__":
    main()
