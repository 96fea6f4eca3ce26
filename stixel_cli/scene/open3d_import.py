"""The one place where Open3D is imported: it needs preparation, and all of it takes seconds."""

import ctypes
import importlib.util
import os
import sys
from contextlib import suppress
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from threading import Lock
from types import ModuleType

_lock = Lock()


def import_open3d() -> ModuleType:
    """All of Open3D, ready for use without a display and on a machine that lacks libusb.

    Open3D's wheels link libusb-1.0, which a fresh machine does not have: the package
    `libusb_package` ships it, and loaded first with its symbols global it serves. The Filament
    renderer asks for a display unless EGL_PLATFORM is set before the import.
    """
    _prepare()
    import open3d

    return open3d


def import_open3d_bindings() -> ModuleType:
    """Open3D's compiled part: `core`, `geometry`, `io`, `t`, `utility`.

    Open3D's own `__init__` imports this and then its viewers and its machine learning, with
    scikit-learn, pandas, Plotly and Dash: three times the work. Where the package has another
    layout than expected, or is imported already, this is the whole of Open3D. The functions are
    the same ones, and a later `import open3d` adds the rest to them.
    """
    spec = None if "open3d" in sys.modules else _bindings()
    if spec is None:
        return import_open3d()
    with _lock:
        if spec.name not in sys.modules:
            _prepare()
            with suppress(ImportError):
                bindings = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(bindings)
                sys.modules[spec.name] = bindings
    return sys.modules.get(spec.name) or import_open3d()


def _prepare() -> None:
    os.environ.setdefault("EGL_PLATFORM", "surfaceless")
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


def _bindings() -> ModuleSpec | None:
    """The compiled part; None if Open3D is not installed, or as its CUDA version."""
    package = importlib.util.find_spec("open3d")
    folder = None if package is None or package.origin is None else Path(package.origin).parent
    # The CUDA version chooses between two compiled parts, and only one may be loaded.
    if folder is None or (folder / "cuda").exists():
        return None
    # Open3D 0.19 has it in the folder `cpu`, 0.20 next to its `__init__`. The name is the one that
    # Open3D itself gives it, for a later `import open3d`: it can be initialised only once.
    places = {"open3d.cpu.pybind": folder / "cpu", "open3d.pybind": folder}
    found = (PathFinder.find_spec(name, [str(place)]) for name, place in places.items())
    return next(filter(None, found), None)
