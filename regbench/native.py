"""Shared libraries that wheels expect of the system but a bare machine lacks."""

from __future__ import annotations

import ctypes
import ctypes.util
import sys


def load_libusb() -> None:
    """Make libusb-1.0 known to this process, from the `libusb-package` wheel if the system has none.

    open3d's wheel links libusb-1.0.so.0 and does not import without it. Once a library with that SONAME is loaded,
    the dynamic linker is content. Cheap (under a millisecond), and a no-op where the system has the library.
    """
    if not sys.platform.startswith("linux"):
        return
    try:
        ctypes.CDLL("libusb-1.0.so.0", mode=ctypes.RTLD_GLOBAL)
    except OSError:
        try:
            import libusb_package
        except ImportError:
            return  # open3d's own ImportError then names the missing library
        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
