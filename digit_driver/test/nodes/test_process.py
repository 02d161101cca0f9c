"""The driver's executable, on a machine without a DIGIT: how it ends, and what it says then."""

from __future__ import annotations

import signal

import pytest
from process_rig import started

pytestmark = pytest.mark.dds
DRIVER = "digit_driver.nodes.digit_driver"
# Given up before the node has begun to wait, it would be bad input: that takes a moment on a busy machine.
NO_SENSOR = "{serial: no-such-serial, wait_for_device_timeout: 2.0, reconnect_timeout: 0.1}"


@pytest.mark.parametrize(
    ("yaml", "code", "named"),
    [("camera_info_url: /nowhere", 2, "camera_info_url: /nowhere"), (NO_SENSOR, 1, "no-such-serial")],
)
def test_process_ends_with_a_code_and_one_reason(tmp_path, yaml, code, named) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(f"digit_driver:\n  ros__parameters:\n    {yaml}\n")
    process = started(DRIVER, "--params-file", str(path))
    _, errors = process.communicate()
    assert process.returncode == code, errors
    assert named in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize(("moment", "number"), [("no-such-serial", signal.SIGINT), ("]: active", signal.SIGTERM)])
def test_a_signal_ends_it_well_at_its_start_and_while_it_spins(moment, number) -> None:
    process = started(DRIVER, "-p", "serial:=no-such-serial")
    for line in process.stderr:
        if moment in line:
            break
    process.send_signal(number)
    _, errors = process.communicate()
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
