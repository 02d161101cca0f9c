"""Open3D, loaded. Its wheel needs libusb, for depth cameras; the one from PyPI serves if the system has none."""

from __future__ import annotations

import contextlib
import ctypes

with contextlib.suppress(ImportError):
    import libusb_package

    # The loader takes a library that is loaded already if Open3D asks for one of the same name.
    ctypes.CDLL(str(libusb_package.get_library_path()))

import open3d

open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
