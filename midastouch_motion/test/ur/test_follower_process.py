"""The process, over programs that behave badly, and over ur-rtde and a controller."""

import os
import signal
import sys
import threading
import time

import numpy as np
import pytest

from midastouch_motion.ur import follower_process, ur_follower
from midastouch_motion.ur.follower_process import FollowerProcess
from midastouch_motion.ur.ur_control import Stopping

from .controller_process import ADDRESS, BASE_FROM_TCP, until

TWIST = np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.3])
VELOCITY = np.concatenate([BASE_FROM_TCP[:3, :3] @ TWIST[:3], BASE_FROM_TCP[:3, :3] @ TWIST[3:]])


@pytest.fixture
def followed():
    """Starts one that follows; attribute `said`: its troubles, one after the other."""
    running = []

    def start(command: list[str], pause: float = 0.1) -> FollowerProcess:
        said = []
        process = FollowerProcess(command, pause, said.append)
        process.said = said
        running.append(process)
        return process

    yield start
    for process in running:
        process.close()
    assert not any(thread.name == "ur_follower" for thread in threading.enumerate())


def program(text: str) -> list[str]:
    return [sys.executable, "-c", f"import os, sys, time\n{text}"]


SILENT = program("print('ready', flush=True); time.sleep(600)")


def real(timeout: float = 10.0) -> list[str]:
    return ur_follower.command(ADDRESS, Stopping(0.5, 5.0, timeout))


def test_a_program_that_is_ended_is_said_and_started_again(followed):
    process = followed(program("print('ready', flush=True); os.abort()"))
    until(lambda: process.connections >= 2)
    assert f"exit code {-signal.SIGABRT}" in process.said[1]


def test_the_reason_of_a_program_is_said(followed):
    process = followed(program("print('trouble no arm'); sys.exit(1)"))
    until(lambda: process.said)
    assert process.said[0] == process.trouble == "no arm"


def test_a_program_that_does_not_start_is_tried_again(followed, tmp_path):
    missing = tmp_path / "program"
    process = followed([str(missing)])
    until(lambda: process.said)
    assert "does not start" in process.trouble
    missing.write_text("#!/bin/sh\necho ready; exec sleep 600\n")
    missing.chmod(0o700)
    until(lambda: process.connections)


def test_a_program_that_hangs_is_ended(followed, monkeypatch):
    monkeypatch.setattr(follower_process, "SILENT_S", 0.2)
    process = followed(SILENT)
    until(lambda: process.connections >= 2)
    assert process.said[1] == "ur-rtde does not answer any more"


def test_a_full_pipe_blocks_nobody(followed):
    process = followed(SILENT)
    until(lambda: not process.trouble)
    for _ in range(2000):
        process.send(TWIST)


def test_orders_reach_the_controller_as_velocities_in_base(ur_controller, followed):
    controller = ur_controller()
    process = followed(real())
    until(lambda: not process.trouble)
    process.send(TWIST)
    until(lambda: controller.said("speed"))
    np.testing.assert_allclose(controller.said("speed")[0], VELOCITY, atol=1e-12)
    assert controller.said("acceleration")[0] == 0.5
    assert set(controller.said("watchdog")) == {0.1}
    process.close()
    until(lambda: controller.said("stopped"))
    assert (controller.said("speed_stop"), controller.said("stopped")) == ([5.0], ["asked"])


def test_an_arm_stops_once_orders_stop_coming(ur_controller, followed):
    controller = ur_controller()
    process = followed(real(timeout=0.5))
    sent = 0.0

    def send() -> list:
        nonlocal sent
        if process.broken_off:  # on a busy machine: then a new motion; an order of zero would stop one that goes on
            process.send(np.zeros(6))
        sent = time.monotonic()
        process.send(TWIST)
        return controller.said("speed")

    until(send)

    def stops() -> list[float]:
        """When it has stopped since the last order; what was broken off before has stopped, too."""
        since = [event for event in [*controller.events] if event["at"] > sent]
        return [event["at"] for event in since if "speed_stop" in event or "stopped" in event]

    # By the program. On a machine that is too busy for it by the watchdog, which is what that is for.
    until(stops)
    assert stops()[0] - sent == pytest.approx(0.5, abs=0.5)


def test_the_watchdog_stops_an_arm_whose_program_is_killed(ur_controller, followed, tmp_path):
    controller = ur_controller()
    pid = tmp_path / "pid"
    text = f"open({str(pid)!r}, 'w').write(str(os.getpid())); os.execv(sys.executable, {real(timeout=2.0)!r})"
    process = followed(program(text), pause=600.0)
    until(lambda: not process.trouble)
    process.send(TWIST)
    until(lambda: controller.said("speed"))
    os.kill(int(pid.read_text()), signal.SIGKILL)
    until(lambda: controller.said("stopped"))
    assert controller.said("stopped") == ["watchdog"]


def test_a_motion_that_was_broken_off_does_not_go_on(ur_controller, followed, monkeypatch):
    monkeypatch.setattr(follower_process, "PAUSE_S", 60.0)  # for which no machine stands still
    first = ur_controller()
    process = followed(real())
    until(lambda: not process.trouble)
    first.end()
    until(lambda: process.send(TWIST) or process.trouble)
    second = ur_controller()
    until(lambda: process.send(TWIST) or not process.trouble)
    for _ in range(20):
        process.send(TWIST)
    assert process.broken_off
    process.send(np.zeros(6))
    process.send(2 * TWIST)
    assert not process.broken_off
    until(lambda: second.said("speed"))
    np.testing.assert_allclose(second.said("speed")[0], 2 * VELOCITY, atol=1e-12)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("old protocol", "refuses protocol 2"),
        ("inputs in use", "input registers are already in use"),
        ("local control", "enable remote control"),
        pytest.param("silent script", "the program does not start", marks=pytest.mark.slow),
    ],
)
def test_a_controller_that_refuses_says_why(ur_controller, followed, fault, reason):
    ur_controller(fault)
    process = followed(real())
    until(lambda: process.said)
    assert reason in process.said[0]
