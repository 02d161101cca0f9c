import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    """The workspace."""
    return ROOT


@pytest.fixture
def load_tool(monkeypatch):
    """Import a script of tools/ as a module of its own: ``load_tool("setup_workspace")``."""

    def load(name: str):
        path = ROOT / "tools" / f"{name}.py"
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, path.stem, module)
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        monkeypatch.syspath_prepend(path.parent)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def context():
    """A ROS context of its own; for tests marked `dds`."""
    import rclpy

    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()
