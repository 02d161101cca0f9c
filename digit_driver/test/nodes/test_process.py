"""The driver's executable: how it ends, and what it says then."""

from __future__ import annotations

import signal

import pytest

pytestmark = pytest.mark.dds


@pytest.mark.parametrize(
    ("yaml", "code", "words"),
    [
        ("intensitty: 3", 2, "no parameter intensitty; did you mean intensity?"),
        ("replay_path: /nowhere", 2, "/nowhere does not exist"),
        ("{serial: no-such-serial, wait_for_device_timeout: 0.1, reconnect_timeout: 0.1}", 1, "no DIGIT"),
    ],
)
def test_process_ends_with_a_code_and_one_reason(run_driver, tmp_path, yaml, code, words) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(f"digit_driver:\n  ros__parameters:\n    {yaml}\n")
    process = run_driver("--params-file", str(path))
    _, errors = process.communicate()
    assert process.returncode == code, errors
    assert words in errors
    assert "Traceback" not in errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("moment", ["240x320 at 60 frames/s", "played to its end"])
def test_process_ends_well_when_told_to_while_starting_and_while_spinning(run_driver, folder, number, moment) -> None:
    process = run_driver("-p", f"replay_path:={folder}", "-p", "replay_loop:=false")
    for line in process.stderr:
        if moment in line:
            break
    process.send_signal(number)
    _, errors = process.communicate()
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
