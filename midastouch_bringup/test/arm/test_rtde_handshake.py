"""Against a server that speaks RTDE, and against ones that do not."""

import contextlib
import socket
import sys
import threading
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from rtde_server import serve

from midastouch_bringup.arm.rtde_handshake import require_outputs

OUTPUTS = ["timestamp", "actual_TCP_pose", "actual_q", "actual_qd"]


@pytest.fixture
def listen():
    """Starts a server that treats one client as told; returns its port."""
    with contextlib.ExitStack() as open_:

        def start(treat) -> int:
            server = open_.enter_context(socket.create_server(("127.0.0.1", 0)))

            def once() -> None:
                with contextlib.suppress(OSError):
                    client, _ = server.accept()
                    with client:
                        treat(client)

            threading.Thread(target=once, daemon=True).start()
            return server.getsockname()[1]

        yield start


def ask(port: int, timeout: float = 60.0) -> None:
    require_outputs("127.0.0.1", port, OUTPUTS, 125.0, timeout)


def test_a_controller_that_gives_the_outputs(listen):
    ask(listen(lambda client: serve(client, "")))


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("old protocol", "refuses protocol 2"),
        ("unknown output", "does not give timestamp, actual_TCP_pose"),
        ("refused start", "refuses to start"),
    ],
)
def test_a_controller_that_refuses(listen, fault, reason):
    port = listen(lambda client: serve(client, fault))
    with pytest.raises(ConnectionError, match=f"no RTDE at 127.0.0.1:{port}: .*{reason}"):
        ask(port)


@pytest.mark.parametrize(
    ("said", "reason", "timeout"),
    [
        (b"", "timed out", 0.1),
        (b"\x00\x05V", "timed out", 0.1),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "does not speak RTDE", 60.0),
        (b"\x00\x01V", "does not speak RTDE", 60.0),
        (b"\x00\x04V\x01\x00\x0aO\x01DOUBLE", "does not give timestamp", 60.0),
    ],
)
def test_what_is_no_controller(listen, said, reason, timeout):
    def treat(client) -> None:
        client.sendall(said)
        while client.recv(100):
            pass

    with pytest.raises(ConnectionError, match=reason):
        ask(listen(treat), timeout)


def test_a_controller_that_hangs_up(listen):
    with pytest.raises(ConnectionError, match="closed the connection"):
        ask(listen(lambda client: client.recv(100)))


def test_text_messages_in_between_are_passed_over(listen):
    def treat(client) -> None:
        client.sendall(b"\x00\x08Mhello")
        serve(client, "")

    ask(listen(treat))


def test_nobody_there():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(ConnectionError, match=f"no RTDE at 127.0.0.1:{port}: .*refused"):
        ask(port)
