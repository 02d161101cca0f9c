"""`midastouch view` as a process: a recording of it, and a client of its server."""

import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from ports import free_ports

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra
from midastouch_tools import cli

SCENE = {"object/particles", "object/modes", "object/gel", "object/estimate/here", "image", "status"}
SCENE |= {"calibration", "image/next"}


def test_without_rerun_it_names_the_command_that_installs_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert cli.main(["view"]) == 2
    assert install_extra("view") in capsys.readouterr().err


@pytest.fixture
def rerun():
    return pytest.importorskip("rerun", reason="the view extra (rerun-sdk) is not installed")


def binary() -> str:
    import rerun_cli

    return str(Path(rerun_cli.__file__).parent / "rerun")


def drawn(recording: Path) -> set[str]:
    """Entities of a recording."""
    done = subprocess.run([binary(), "rrd", "print", str(recording)], capture_output=True, text=True)
    return set(re.findall(r" - /(\S+) - ", done.stdout))


@pytest.fixture
def start(graph):
    """Starts `midastouch view` on the graph's domain; ended with the test, however that ends."""
    processes = []

    def start(*arguments) -> subprocess.Popen:
        command = [sys.executable, "-m", "midastouch_tools.cli", "view", "--rate", "20", *map(str, arguments)]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True))
        return processes[-1]

    yield start
    for process in processes:
        process.terminate()
        try:
            process.communicate(timeout=120)
        finally:
            process.kill()


def scene_sender(graph):
    """A function that publishes once what a filter and a sensor would; the view is connected to all of it."""
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from geometry_msgs.msg import PoseWithCovarianceStamped
    from sensor_msgs.msg import Image, PointCloud2
    from std_msgs.msg import Header

    from midastouch_common import se3
    from midastouch_common.ros.conversions import image_to_msg
    from midastouch_filter.nodes.markers import particle_cloud
    from midastouch_msgs.msg import FilterStatus, PoseMode, PoseModes

    header = Header(frame_id="object")
    mode = PoseMode(weight=1.0)
    mode.pose.pose.orientation.w = 1.0
    poses = se3.translation(np.random.default_rng(0).normal(0, 0.1, (100, 3)))
    guide = DiagnosticStatus(name="calibrate: /calibrate", values=[KeyValue(key="region", value="centre")])
    messages = (
        (DiagnosticArray, "/diagnostics", DiagnosticArray(status=[guide]), False),
        (PointCloud2, "particles/cloud", particle_cloud(poses, np.full(100, 0.01), header), False),
        (PoseModes, "pose_modes", PoseModes(header=header, modes=[mode]), False),
        (PoseWithCovarianceStamped, "pose", PoseWithCovarianceStamped(header=header, pose=mode.pose), True),
        (Image, "image_raw", image_to_msg(np.zeros((32, 24, 3), np.uint8), "rgb8", header), False),
        (FilterStatus, "filter_status", FilterStatus(header=header, state="converged"), True),
    )
    connected = [(graph.publisher(kind, topic, latched=latched), message) for kind, topic, message, latched in messages]

    def send() -> None:
        for publisher, message in connected:
            publisher.publish(message)
        graph.spin_for(0.1)

    return send


@pytest.mark.slow
@pytest.mark.dds
def test_a_recording_holds_what_the_nodes_published(rerun, graph, start, tmp_path):
    out = tmp_path / "run.rrd"
    view = start("--save", out)
    send = scene_sender(graph)
    for _ in range(20):  # what is best effort may be lost while both sides find each other
        send()
    assert not out.exists()  # nothing half-written under its name
    view.send_signal(signal.SIGINT)
    said, _ = view.communicate(timeout=120)
    assert view.returncode == 0, said
    assert drawn(out) >= SCENE
    assert [path.name for path in tmp_path.iterdir()] == ["run.rrd"]


@pytest.mark.slow
@pytest.mark.dds
def test_a_client_gets_the_scene_from_the_server(rerun, graph, start, tmp_path):
    port, web_port, own_port = free_ports(3)
    view = start("--port", port, "--web-port", web_port)
    assert view.stdout.readline().startswith(f"open http://127.0.0.1:{web_port}/?url=")
    with socket.create_connection(("127.0.0.1", web_port)) as page:
        page.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
        assert page.recv(100).startswith(b"HTTP/1.1 200")
    send = scene_sender(graph)
    got = tmp_path / "got.rrd"
    source = f"rerun+http://127.0.0.1:{port}/proxy"
    command = [binary(), source, "--save", str(got), "--bind", "127.0.0.1", "--port", str(own_port)]
    client = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 120
        while not (got.exists() and drawn(got) >= SCENE):
            assert time.monotonic() < deadline, f"the client got {got.exists() and drawn(got)}"
            send()
    finally:
        client.terminate()
        client.wait(120)
    view.terminate()
    said, _ = view.communicate(timeout=120)
    assert view.returncode == 0, said
    with pytest.raises(ConnectionRefusedError):  # the server went with it
        socket.create_connection(("127.0.0.1", port))


def test_a_port_in_use_and_a_bad_host_are_refused(rerun):
    from midastouch_tools.view.server import ViewServer

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"127.0.0.1 port {port}: .*choose another"):
            ViewServer("127.0.0.1", port, free_ports(1)[0], 100)
    with pytest.raises(InputError, match="not an IP address"):
        ViewServer("localhost", 9876, 9090, 100)


def test_it_listens_to_this_machine_only_unless_told(rerun):
    from midastouch_tools.view.server import ViewServer

    port, web_port = free_ports(2)
    with ViewServer("127.0.0.1", port, web_port, 100):
        listening = Path("/proc/net/tcp").read_text() + Path("/proc/net/tcp6").read_text()
        for number in (port, web_port):
            addresses = re.findall(rf" ([0-9A-F]+):{number:04X} \S+ 0A ", listening)
            assert addresses == ["0100007F"]
