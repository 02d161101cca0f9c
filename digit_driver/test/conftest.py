"""Fakes and marks shared by the driver's tests."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import pytest
from fake_kernel import FakeKernel

from digit_driver.discovery import find_cameras


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "hardware: needs a real DIGIT; runs only with DIGIT_HARDWARE=1")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if os.environ.get("DIGIT_HARDWARE") == "1":
        return
    for item in items:
        if item.get_closest_marker("hardware"):
            item.add_marker(pytest.mark.skip(reason="needs a DIGIT; set DIGIT_HARDWARE=1 to run"))


@pytest.fixture
def kernel(tmp_path: Path) -> FakeKernel:
    """A machine without cameras, to plug some into."""
    return FakeKernel(tmp_path)


@pytest.fixture
def find(kernel: FakeKernel):
    """``find_cameras`` on that machine."""
    return functools.partial(find_cameras, sysfs=kernel.sysfs, dev=kernel.dev)
