"""The driver's node on the fake machine."""

from __future__ import annotations

import functools

import pytest
from fake_kernel import FakeDigit

from digit_driver.nodes.digit_driver import DigitDriver
from digit_driver.v4l2_device import V4l2Camera


@pytest.fixture
def start(graph, kernel, find):
    """Starts a driver on the fake machine, in the namespace /digit_test, with the given parameters."""
    make_camera = functools.partial(V4l2Camera, system=kernel, find=find)
    return lambda **parameters: graph.add(
        lambda **options: DigitDriver(make_camera, **options), parameters, namespace="/digit_test"
    )


@pytest.fixture
def camera(kernel) -> FakeDigit:
    """A sensor plugged into the fake machine."""
    return kernel.plug(FakeDigit("D20001"))
