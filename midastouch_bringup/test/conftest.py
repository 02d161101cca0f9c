"""A launch without ROS 2's."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

# the stand-ins beside this file can be imported
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def stand_ins(monkeypatch, tmp_path):
    """Stand-ins of launch, over an installation with what it is to start beside our nodes."""
    from fake_launch import DEPENDENT, installation, modules

    for name, module in modules(tmp_path).items():
        monkeypatch.setitem(sys.modules, name, module)
    prefixes = [installation(tmp_path / "prefix"), os.environ["AMENT_PREFIX_PATH"]]
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(prefixes))
    monkeypatch.delitem(sys.modules, DEPENDENT, raising=False)
    yield
    # the module was imported on top of the stand-ins: nobody else may get it
    sys.modules.pop(DEPENDENT, None)
