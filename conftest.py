"""Settings for every test of the workspace.

The packages are imported here, before any test: in importlib mode pytest calls `midastouch_filter/test/x.py`
the module `midastouch_filter.test.x`, whose parent would be the folder in the workspace, not the package of
that name inside it, unless that is loaded already.
"""

from __future__ import annotations

import itertools
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

import digit_driver  # noqa: F401
import midastouch_bringup  # noqa: F401
import midastouch_filter  # noqa: F401
import midastouch_kernels  # noqa: F401
import midastouch_perception  # noqa: F401

if TYPE_CHECKING:
    from midastouch_perception.ros.testing import Graph

# on a busy machine time says nothing about the code
settings.register_profile("workspace", deadline=None, derandomize=True)
settings.load_profile("workspace")


def _claim_domain() -> tuple[int, socket.socket]:
    """A DDS domain that no other run of tests on this machine has, and what is to be kept as long as it is ours.

    Of 1 to 101, whose ports Linux keeps out of its ephemeral range.
    """
    for domain in itertools.chain(range(1 + os.getpid() % 101, 102), range(1, 102)):
        claim = socket.socket(socket.AF_UNIX)
        try:
            # abstract, so it is free again when the process is gone, however it ends
            claim.bind(f"\0midastouch_test_domain_{domain}")
        except OSError:
            claim.close()
        else:
            return domain, claim
    raise RuntimeError("each of 101 DDS domains belongs to a run of tests that is under way")


# Programs that tests start inherit both. Only this machine hears them.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
_domain, _claim = _claim_domain()
os.environ["ROS_DOMAIN_ID"] = str(_domain)


@pytest.fixture(autouse=True)
def _heeding_signals() -> Iterator[None]:
    """Puts the handlers of signals back: an executable's `main`, called in this process, leaves them ignored, and the
    processes that later tests start would inherit that."""
    former = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in former.items():
        signal.signal(number, handler)


@pytest.fixture
def graph() -> Iterator[Graph]:
    """A ROS graph for one test."""
    from midastouch_perception.ros.testing import open_graph

    with open_graph() as opened:
        yield opened


@pytest.fixture
def brisk_health(monkeypatch) -> None:
    """Nodes tell their health ten times a second, for tests that wait to hear of it."""
    monkeypatch.setattr("midastouch_perception.ros.diagnostics.PERIOD_S", 0.1)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of scans and slides beside the clone."""
    folder = Path(__file__).resolve().parent.parent / "shared"
    if not folder.is_dir():
        pytest.skip("no ../shared folder beside the clone")
    return folder
