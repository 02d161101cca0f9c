"""A finished run looked at in three dimensions. What is drawn needs NumPy alone; who draws it is Open3D, the `open3d`
extra."""

from __future__ import annotations

from types import ModuleType

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra

SYSTEM = "libgl1, libegl1, libx11-6 and libusb-1.0-0 (the last also from PyPI: libusb-package)"


def require_open3d() -> ModuleType:
    """The module `open3d`; InputError with the fix when it, or a system library that it wants, is missing."""
    try:
        from .library import open3d
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError):
            raise InputError(f"this needs Open3D (105 MB): {install_extra('open3d')}") from error
        raise InputError(f"Open3D does not load ({error}); it wants {SYSTEM} of the system") from error
    return open3d
