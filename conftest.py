"""Settings for every test of the workspace.

The packages are imported here, before any test: in importlib mode pytest calls `midastouch_filter/test/x.py`
the module `midastouch_filter.test.x`, whose parent would be the folder in the workspace, not the package of
that name inside it, unless that is loaded already.
"""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

import digit_driver  # noqa: F401
import midastouch_benchmark  # noqa: F401
import midastouch_bringup  # noqa: F401
import midastouch_common  # noqa: F401
import midastouch_filter  # noqa: F401
import midastouch_kernels  # noqa: F401
import midastouch_motion  # noqa: F401
import midastouch_perception  # noqa: F401
import midastouch_simulation  # noqa: F401
import midastouch_tools  # noqa: F401
from midastouch_tools.processes.local_domain import claimed_domain

if TYPE_CHECKING:
    from ros_graph import RosGraph

# on a busy machine time says nothing about the code
settings.register_profile("workspace", deadline=None, derandomize=True)
settings.load_profile("workspace")

# what tests share, in any folder of tests; each such module has a name of its own
_ROOT = Path(__file__).parent
_SHARED = (path for path in _ROOT.glob("*/test/**/*.py") if not re.match("test_|conftest", path.name))
sys.path[:0] = map(str, (_ROOT / "tests", *sorted({path.parent for path in _SHARED})))
pytest_plugins = ["meshes", "sensors", "sequences", "pictured_run"]

# Programs that tests start inherit both. Only this machine hears them.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(claimed_domain())
# a shell's job in the background ignores Ctrl-C, and every program that it starts
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _heeding_signals() -> Iterator[None]:
    """Puts the handlers of signals back: an executable's `main`, called in this process, leaves them ignored, and the
    processes that later tests start would inherit that."""
    former = {
        number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    }
    yield
    for number, handler in former.items():
        signal.signal(number, handler)


@pytest.fixture
def signals_are_heard(_heeding_signals: None) -> None:
    """As in a terminal, also when the tests themselves were started with nohup or in the background of a script."""
    for number in (signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_DFL)


@pytest.fixture
def graph() -> Iterator[RosGraph]:
    """A ROS graph for one test."""
    from ros_graph import open_graph

    with open_graph() as opened:
        yield opened


@pytest.fixture
def brisk_health(monkeypatch) -> None:
    """Nodes tell their health ten times a second, for tests that wait to hear of it."""
    monkeypatch.setattr("midastouch_common.ros.diagnostics.PERIOD_S", 0.1)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of scans and slides beside the clone."""
    folder = Path(__file__).resolve().parent.parent / "shared"
    if not folder.is_dir():
        pytest.skip("no ../shared folder beside the clone")
    return folder
