"""The compose files and the health check against the tree and the Dockerfile. Nothing is started here but a node."""

import importlib.metadata
import importlib.util
import re
import shlex
import threading
from pathlib import Path

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from launch_rig import carried_out

from midastouch_tools.cli import build_parser

ROOT = Path(__file__).parents[2]
DOCKER = ROOT / "docker"
if not DOCKER.is_dir():
    pytest.skip("the container files are only in the source tree", allow_module_level=True)
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text())
FINAL = ("cpu", "dev", "gpu")  # stages, which test_docker.py looks at
GPU = yaml.safe_load((DOCKER / "compose.gpu.yaml").read_text())


def commands(service):
    command = service["command"]
    if isinstance(command, str):
        # variables with an alternative are set, the others have their default
        filled = re.sub(r"\$\{(\w+):\+([^$}]*)\$\{\1:-\}\}", r"\2value", command)
        filled = re.sub(r"\$\{(\w+):-([^}]*)\}", r"\2", filled)
        return shlex.split(filled)
    return command


def test_compose_services_build_stages_that_exist():
    version = importlib.metadata.version("midastouch_bringup")
    assert {"demo", "live", "dev"} == COMPOSE["services"].keys()
    for name, service in COMPOSE["services"].items():
        assert service["profiles"] == [name]
        target = service["build"]["target"]
        assert target in FINAL
        assert service["image"] == f"midastouch:{version}-{target}"
        assert (DOCKER / service["build"]["context"] / service["build"]["dockerfile"]).is_file()


def test_compose_gives_no_more_rights_than_needed():
    for service in COMPOSE["services"].values():
        assert not service.get("privileged", False)
        assert service["cap_drop"] == ["ALL"]
        assert "no-new-privileges:true" in service["security_opt"]
        assert service["network_mode"] == service["ipc"] == "host"


def test_live_survives_unplugging_the_camera():
    live = COMPOSE["services"]["live"]
    assert "devices" not in live
    assert live["device_cgroup_rules"] == ["c 81:* rmw"]
    assert {"/dev:/dev", "/run/udev:/run/udev:ro"} <= set(live["volumes"])


def test_gpu_override_changes_services_that_exist():
    assert GPU["services"].keys() <= COMPOSE["services"].keys()
    for service in GPU["services"].values():
        assert service["build"]["target"] == "gpu"
        (device,) = service["deploy"]["resources"]["reservations"]["devices"]
        assert (device["driver"], device["capabilities"]) == ("nvidia", ["gpu"])


def test_commands_are_ours():
    programs = 0
    for service in COMPOSE["services"].values():
        if "command" not in service:
            continue
        program, *arguments = commands(service)
        if program == "midastouch":
            build_parser().parse_args(arguments)
        else:
            assert [program, *arguments[:2]] == ["ros2", "launch", "midastouch_bringup"]
            launch_file = ROOT / "midastouch_bringup" / "launch" / arguments[2]
            given = {argument.partition(":=")[0] for argument in arguments[3:]}
            assert all(":=" in argument for argument in arguments[3:])
            assert launch_file.is_file()
            assert {"object", "serial"} <= given
        programs += 1
    assert programs == 2


def test_live_is_healthy_when_all_its_nodes_are(tmp_path):
    form, entrypoint, script, *asked = COMPOSE["services"]["live"]["healthcheck"]["test"]
    assert (form, entrypoint, script) == ("CMD", "/usr/local/bin/entrypoint.sh", "healthcheck.py")
    assert set(asked) == carried_out("live_ur", tmp_path).keys() - {"mount_tf"}  # which reports nothing


@pytest.fixture
def healthcheck():
    spec = importlib.util.spec_from_file_location("healthcheck", DOCKER / "healthcheck.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.dds
def test_health_is_whether_the_nodes_speak(healthcheck):
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("speaker", context=context)
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    names = ("tdn: /left/tdn", "digit_driver: /left/digit_driver")
    message = DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names])
    stop = threading.Event()

    def speak():
        while not stop.wait(0.1):
            publisher.publish(message)

    thread = threading.Thread(target=speak)
    thread.start()
    try:
        assert healthcheck.silent_nodes({"tdn", "digit_driver"}, 60.0, context) == set()
        assert healthcheck.silent_nodes({"particle_filter"}, 0.5, context) == {"particle_filter"}
    finally:
        stop.set()
        thread.join()
        node.destroy_node()
        context.shutdown()
