"""Sources of launch descriptions."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from .substitution import perform


class PythonLaunchDescriptionSource:
    """A launch file in Python."""

    def __init__(self, launch_file_path):
        self._path = launch_file_path

    def get_launch_description(self, context):
        """Return its description. Raises RuntimeError if there is no such file."""
        path = Path(perform(context, self._path))
        if not path.is_file():
            raise RuntimeError(f"{path}: no such launch file")
        spec = importlib.util.spec_from_file_location(path.name.replace(".", "_"), path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.generate_launch_description()
