"""The live view in a browser: its scene and its server. Needs the `view` extra (Rerun); without ROS."""

from __future__ import annotations

from types import ModuleType

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra


def require_rerun() -> ModuleType:
    """Return the module `rerun`; InputError with the command that installs it if it is missing."""
    try:
        import rerun
    except ImportError as error:
        raise InputError(f"the live view needs Rerun (170 MB): {install_extra('view')}") from error
    return rerun
