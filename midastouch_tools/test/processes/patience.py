"""Waits for what processes do."""

import time

FOR_EVER = "while :; do sleep 0.05; done"  # for the shell
PATIENCE = 120.0  # s; bounds a failing test only


def wait_for(condition, what="it") -> None:
    """Wait until the condition holds; AssertionError naming `what` if that does not come."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"{what} did not come"
        time.sleep(0.01)
