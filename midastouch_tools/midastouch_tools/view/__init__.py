"""A run in three dimensions, live or finished: drawn by Rerun in a browser, or written as clouds by Open3D. Both are
extras; without ROS."""

from __future__ import annotations

from types import ModuleType

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra

SYSTEM = "libgl1, libegl1, libx11-6 and libusb-1.0-0 (the last also from PyPI: libusb-package)"


def require_rerun() -> ModuleType:
    """Return the module `rerun`; InputError with the command that installs it if it is missing."""
    try:
        import rerun
    except ImportError as error:
        raise InputError(f"the view needs Rerun (170 MB): {install_extra('view')}") from error
    return rerun


def require_open3d() -> ModuleType:
    """Return the module `open3d`; InputError with the fix if it, or a system library that it needs, is missing."""
    try:
        from .open3d_library import open3d
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError):
            raise InputError(f"this needs Open3D (105 MB): {install_extra('open3d')}") from error
        raise InputError(f"Open3D does not load ({error}); it wants {SYSTEM} of the system") from error
    return open3d
