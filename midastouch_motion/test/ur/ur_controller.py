"""A UR controller, as a program: its dashboard, its script port and its RTDE port, as far as ur-rtde asks.

Each thing that a test wants to know of is a line of JSON on stdout. Sources: Universal Robots, "Real-Time Data Exchange
(RTDE) Guide" and "Dashboard Server". What ur-rtde's program does with the registers was read in what the library sends
to the script port.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import socket
import struct
import sys
import threading
import time

DASHBOARD, SCRIPT, RTDE = 29999, 30003, 30004
PERIOD = 0.002
STOPPED, PLAYING = 1, 2  # runtime states
READY, DONE = 1, 2  # what the program writes into output_int_register_0
SPEED_L, SPEED_STOP, SET_WATCHDOG, STOP_SCRIPT = 10, 15, 35, 255  # what it finds in input_int_register_0
FORMATS = {"INT32": "i", "UINT32": "I", "DOUBLE": "d", "VECTOR6D": "6d"}
POSE = [0.3, -0.2, 0.4, 0.1, 2.6, -0.2]
WRENCH = [1.0, -2.0, 12.5, 0.1, 0.2, -0.3]
# packages. ur-rtde returns from its constructor up to 0.55 s after the start; a shorter connection is never seen alive
FAULTY_AFTER = 125


def kind_of(name: str) -> str:
    """The type of an input or output."""
    if "_int_register_" in name:
        return "INT32"
    if name in ("robot_status_bits", "safety_status_bits", "runtime_state"):
        return "UINT32"
    return "VECTOR6D" if name.startswith("actual_") else "DOUBLE"


class Controller:
    """Its registers, and the program that runs on it.

    The first joint's angle is the time of the state, so that a reader can tell when each one was measured.
    """

    def __init__(self, fault: str):
        self.fault, self._lock = fault, threading.RLock()
        self._start, self._heard, self._slowest = time.monotonic(), time.monotonic(), None
        self._idle = True
        self.values = {"robot_status_bits": 3, "safety_status_bits": 1, "runtime_state": STOPPED}

    def say(self, **event) -> None:
        """A line for the test."""
        print(json.dumps(event | {"at": time.monotonic()}), flush=True)

    def load(self, script: str) -> None:
        """A program has come."""
        self.say(script=script)
        if self.fault in ("silent script", "local control"):  # in local control it runs no scripts, either
            return
        with self._lock:
            self._heard, self._slowest = time.monotonic(), None
            self.values |= {"runtime_state": PLAYING, "output_int_register_0": READY}

    def stop(self, why: str) -> None:
        """The program ends."""
        with self._lock:
            if self.values["runtime_state"] == PLAYING:
                self.values["runtime_state"] = STOPPED
                self.say(stopped=why)

    def write(self, inputs: dict[str, float]) -> None:
        """Registers are written; the program does what they say."""
        with self._lock:
            self._heard = time.monotonic()
            if self.values["runtime_state"] != PLAYING:
                return
            command = inputs.get("input_int_register_0", 0)
            numbers = [value for name, value in inputs.items() if "double" in name]
            if command == SPEED_L:
                self.say(speed=numbers[:6], acceleration=numbers[6], time=numbers[7])
            elif command and self._idle:
                self._carry_out(command, numbers)
            self._idle = command in (0, SPEED_L)
            self.values["output_int_register_0"] = READY if self._idle else DONE

    def _carry_out(self, command: int, numbers: list[float]) -> None:
        if command == SPEED_STOP:
            self.say(speed_stop=numbers[0])
        elif command == SET_WATCHDOG:
            self._slowest = 1.0 / numbers[0]
            self.say(watchdog=numbers[0])
        elif command == STOP_SCRIPT:
            self.stop("asked")
        else:
            self.say(command=command, numbers=numbers)

    def watch(self) -> None:
        """Stop the program if registers are written too seldom."""
        with self._lock:
            if self._slowest is not None and time.monotonic() - self._heard > self._slowest:
                self.stop("watchdog")

    def state(self, names: list[str]) -> bytes:
        """The outputs of these names, packed."""
        with self._lock:
            now = 1000.0 + time.monotonic() - self._start
            arm = {
                "actual_TCP_force": WRENCH,
                "actual_TCP_pose": POSE,
                "actual_q": [now] + [0.1] * 5,
                "actual_qd": [0.2] * 6,
            }
            known = self.values | arm | {"timestamp": now}
            out = b""
            for name in names:
                kind = kind_of(name)
                value = known.get(name, 0)
                numbers = value if isinstance(value, list) else [value] * (6 if kind == "VECTOR6D" else 1)
                out += struct.pack(">" + FORMATS[kind], *numbers)
            return out


class RtdeClient:
    """One connection to the RTDE port."""

    def __init__(self, connection: socket.socket, controller: Controller):
        self._connection, self._controller = connection, controller
        self._outputs: list[str] = []
        self._period = PERIOD
        self._inputs: list[list[str]] = []

    def serve(self) -> None:
        """Answer until it hangs up."""
        while header := read(self._connection, 3):
            size, letter = struct.unpack(">Hc", header)
            payload = read(self._connection, size - 3)
            if letter == b"U":
                self._take(payload)
            else:
                self._send(letter, self._answer(letter, payload))
            if letter == b"S" and self._controller.fault != "refused start":
                threading.Thread(target=self._stream, daemon=True).start()

    def _answer(self, letter: bytes, payload: bytes) -> bytes:
        fault = self._controller.fault
        if letter == b"V":
            return bytes([payload == struct.pack(">H", 2) and fault != "old protocol"])
        if letter == b"v":
            return struct.pack(">4I", 5, 12, 0, 1101)
        if letter == b"O":
            (frequency,) = struct.unpack(">d", payload[:8])
            self._controller.say(frequency=frequency)
            self._period, self._outputs = 1.0 / frequency, payload[8:].decode().strip(",").split(",")
            kinds = ["NOT_FOUND" if fault == "unknown output" else kind_of(name) for name in self._outputs]
            return bytes([1]) + ",".join(kinds).encode()
        if letter == b"I":
            names = payload.decode().strip(",").split(",")
            self._inputs.append(names)
            kinds = ["IN_USE" if fault == "inputs in use" else kind_of(name) for name in names]
            return bytes([0 if fault == "inputs in use" else len(self._inputs)]) + ",".join(kinds).encode()
        return bytes([fault != "refused start"])

    def _take(self, payload: bytes) -> None:
        names = self._inputs[payload[0] - 1]
        numbers = struct.unpack(">" + "".join(FORMATS[kind_of(name)] for name in names), payload[1:])
        self._controller.write(dict(zip(names, numbers, strict=True)))

    def _stream(self) -> None:
        with contextlib.suppress(OSError):
            self._stream_until_the_fault(self._controller.fault)

    def _stream_until_the_fault(self, fault: str) -> None:
        held = b""
        for number in itertools.count():
            time.sleep(self._period)
            held += package(b"U", bytes([1]) + self._controller.state(self._outputs))
            if fault == "bursts" and number % 40 < 25:
                continue  # on its way for 200 ms, then all at once
            if number == FAULTY_AFTER and fault in ("drop", "cut"):
                self._connection.sendall(held[: len(held) // 2] if fault == "cut" else b"")
                self._connection.shutdown(socket.SHUT_RDWR)
                return
            if number > FAULTY_AFTER and fault == "stall":
                return
            self._connection.sendall(held)
            held = b""

    def _send(self, letter: bytes, payload: bytes) -> None:
        self._connection.sendall(package(letter, payload))


def package(letter: bytes, payload: bytes) -> bytes:
    """A package of RTDE."""
    return struct.pack(">Hc", 3 + len(payload), letter) + payload


def read(connection: socket.socket, size: int) -> bytes:
    """So many bytes; fewer once the other side hangs up."""
    data = b""
    while len(data) < size and (part := connection.recv(size - len(data))):
        data += part
    return data


def serve_rtde(connection: socket.socket, controller: Controller) -> None:
    RtdeClient(connection, controller).serve()


def serve_script(connection: socket.socket, controller: Controller) -> None:
    """Take programs, each from `def` to `end`."""
    text = ""
    while part := connection.recv(65536).decode():
        text += part
        if text.endswith("\nend\n"):
            controller.load(text)
            text = ""


def serve_dashboard(connection: socket.socket, controller: Controller) -> None:
    """Answer a line with a line."""
    remote = "false" if controller.fault == "local control" else "true"
    answers = {
        "PolyscopeVersion": "URSoftware 5.12.0.1101 (Jan 01 2022)",
        "get serial number": "20205500001",
        "is in remote control": remote,
        "stop": "Stopped",
    }
    connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
    for line in connection.makefile():
        asked = line.strip()
        if asked not in answers:
            controller.say(dashboard=asked)
        if asked == "stop":
            controller.stop("dashboard")
        connection.sendall(answers.get(asked, f"could not understand: '{asked}'").encode() + b"\n")


def listen(server: socket.socket, serve, controller: Controller) -> None:
    while True:
        connection, _ = server.accept()

        def treat(connection=connection) -> None:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with connection, contextlib.suppress(OSError):
                serve(connection, controller)

        threading.Thread(target=treat, daemon=True).start()


def main() -> None:
    """Serve at the given address until killed; the second argument is a fault."""
    address, fault = sys.argv[1:]
    controller = Controller(fault)
    services = {DASHBOARD: serve_dashboard, SCRIPT: serve_script, RTDE: serve_rtde}
    servers = {port: socket.create_server((address, port)) for port in services}
    controller.say(ready=True)
    for port, serve in services.items():
        threading.Thread(target=listen, args=[servers[port], serve, controller], daemon=True).start()
    while True:
        time.sleep(PERIOD)
        controller.watch()


if __name__ == "__main__":
    main()
