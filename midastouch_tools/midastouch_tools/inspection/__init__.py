"""Inspection of a finished run in three dimensions. The shapes need NumPy only; Open3D, the `open3d` extra, draws
them."""

from __future__ import annotations

from types import ModuleType

from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra

SYSTEM = "libgl1, libegl1, libx11-6 and libusb-1.0-0 (the last also from PyPI: libusb-package)"


def require_open3d() -> ModuleType:
    """Return the module `open3d`; InputError with the fix if it, or a system library that it needs, is missing."""
    try:
        from .library import open3d
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError):
            raise InputError(f"this needs Open3D (105 MB): {install_extra('open3d')}") from error
        raise InputError(f"Open3D does not load ({error}); it wants {SYSTEM} of the system") from error
    return open3d
