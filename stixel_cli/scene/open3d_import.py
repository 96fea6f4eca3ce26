"""The one place where Open3D is imported: it needs preparation, and all of it takes seconds.

Run as a module with the name of a mesh file, it is a child process that protects its parent: a
damaged file can end the process inside of Open3D, which also prints messages of its own. The arrays
of `read_mesh` go to the standard output as an `.npz` file.
"""

import ctypes
import importlib.util
import io
import os
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from threading import Lock
from types import ModuleType

import numpy as np

_lock = Lock()
_loaded: list[ModuleType] = []


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
    with _lock:
        if "open3d" not in sys.modules:
            if not _loaded:
                _loaded.extend(_load(_bindings_file()))
            if _loaded:
                return _loaded[0]
    return import_open3d()


def _prepare() -> None:
    os.environ.setdefault("EGL_PLATFORM", "surfaceless")
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


def _bindings_file() -> Path | None:
    """The compiled part's file; None if Open3D is not installed, or as its CUDA version."""
    spec = importlib.util.find_spec("open3d")
    if spec is None or spec.origin is None:
        return None
    package = Path(spec.origin).parent
    # Open3D 0.19 has it in the folder `cpu`, 0.20 next to its `__init__`.
    folders = package / "cpu", package
    found = [folder / f"pybind{suffix}" for folder in folders for suffix in EXTENSION_SUFFIXES]
    # The CUDA version chooses between two compiled parts, and only one may be loaded.
    return None if (package / "cuda").exists() else next((f for f in found if f.is_file()), None)


def _load(file: Path | None) -> list[ModuleType]:
    """The module in the file; nothing if it does not load."""
    if file is None:
        return []
    _prepare()
    # The name that Open3D itself gives it.
    name = "open3d.cpu.pybind" if file.parent.name == "cpu" else "open3d.pybind"
    spec = importlib.util.spec_from_file_location(name, file)
    try:
        bindings = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(bindings)
    except ImportError:
        return []
    # For a later `import open3d`: the compiled part can be initialised only once.
    sys.modules[name] = bindings
    return [bindings]


def read_mesh(path: str) -> dict[str, np.ndarray]:
    """The mesh that Open3D reads from a file.

    Returns:
        `vertices` (V, 3) m, `triangles` (T, 3), `uvs` (3 T, 2), `colours` (V, 3) in 0 … 1,
        `materials` (T,), the number of each triangle's texture, and `texture_N` (H, W[, C]) for
        each number N that has an image. All may have no rows.
    """
    mesh = import_open3d_bindings().io.read_triangle_mesh(path)
    images = enumerate(mesh.textures)
    # An empty image (a material without a texture), made an array, would abort the process.
    return {f"texture_{n}": np.asarray(image) for n, image in images if not image.is_empty()} | {
        "vertices": np.asarray(mesh.vertices, dtype=np.float64),
        "triangles": np.asarray(mesh.triangles, dtype=np.int32),
        "uvs": np.asarray(mesh.triangle_uvs, dtype=np.float64),
        "colours": np.asarray(mesh.vertex_colors, dtype=np.float64),
        "materials": np.asarray(mesh.triangle_material_ids, dtype=np.int64),
    }


if __name__ == "__main__":
    answer = os.dup(1)
    os.dup2(2, 1)
    stream = io.BytesIO()
    np.savez(stream, **read_mesh(sys.argv[1]))
    with open(answer, "wb") as file:
        file.write(stream.getbuffer())
