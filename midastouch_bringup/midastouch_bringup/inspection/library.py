"""Open3D, loaded. Its wheel wants a libusb, for depth cameras; one from PyPI serves where the system has none."""

from __future__ import annotations

import contextlib
import ctypes

with contextlib.suppress(ImportError):
    import libusb_package

    # The loader takes what is loaded already for what Open3D asks by the same name.
    ctypes.CDLL(str(libusb_package.get_library_path()))

import open3d

open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
