"""The child process that reads a mesh with Open3D, run as a module with the name of the file.

It protects its parent: a damaged file can end the process inside of Open3D, which also prints
messages of its own. The arrays of `read` go to the standard output as an `.npz` file.
"""

import io
import os
import sys

import numpy as np

from stixel_cli.scene.open3d_import import import_open3d_bindings


def read(path: str) -> dict[str, np.ndarray]:
    """What Open3D finds in the file.

    Returns:
        `vertices` (V, 3) m, `triangles` (T, 3), `uvs` (3 T, 2), `colours` (V, 3) in 0 … 1,
        `materials` (T,), the number of each triangle's texture, and `texture_N` (H, W[, C]) for
        each number N that has an image. All may have no rows.
    """
    found = import_open3d_bindings().io.read_triangle_mesh(path)
    images = enumerate(found.textures)
    # An empty image (a material without a texture), made an array, would abort the process.
    return {f"texture_{n}": np.asarray(one) for n, one in images if not one.is_empty()} | {
        "vertices": np.asarray(found.vertices, dtype=np.float64),
        "triangles": np.asarray(found.triangles, dtype=np.int32),
        "uvs": np.asarray(found.triangle_uvs, dtype=np.float64),
        "colours": np.asarray(found.vertex_colors, dtype=np.float64),
        "materials": np.asarray(found.triangle_material_ids, dtype=np.int64),
    }


if __name__ == "__main__":
    answer = os.dup(1)
    os.dup2(2, 1)
    stream = io.BytesIO()
    np.savez(stream, **read(sys.argv[1]))
    with open(answer, "wb") as file:
        file.write(stream.getbuffer())
