"""The one place where Open3D is imported: it needs preparation, and takes seconds."""

import ctypes
import os
from types import ModuleType


def import_open3d() -> ModuleType:
    """Open3D, ready for use without a display and on a machine that lacks libusb.

    Open3D's wheels link libusb-1.0, which a fresh machine does not have: the package
    `libusb_package` ships it, and loaded first with its symbols global it serves. The Filament
    renderer asks for a display unless EGL_PLATFORM is set before the import.
    """
    os.environ.setdefault("EGL_PLATFORM", "surfaceless")
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d
