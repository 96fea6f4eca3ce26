"""Compiled kernels of the ray caster: rays, hit points, filtered textures, light.

A sample is a point (u, v) in px on the image of a camera, given by `rotation` (3, 3) from the
camera to the frame, `origin` (3,) m, `focal`, `u0`, `v0` px. Directions have depth 1 along the
optical axis, so a ray's parameter is the depth in m. All is in one frame, that of the body asked.
"""

import numpy as np
from numba import njit

MOST_PROBES = 16
"""At most this many look-ups along a footprint's long axis; a longer footprint gets blurred."""

SHADOW_OFFSET = 2e-3
"""Rays to the sun start this far off the surface, m: single precision at 100 m is a tenth of it."""


@njit(cache=True, nogil=True)
def camera_rays(u, v, rotation, origin, focal, u0, v0):
    """Rays (n, 6) float32 (origin, direction) through samples (n,) float64."""
    rays = np.empty((len(u), 6), dtype=np.float32)
    for i in range(len(u)):
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        for axis in range(3):
            rays[i, axis] = origin[axis]
            rays[i, 3 + axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2]
    return rays


@njit(cache=True, nogil=True)
def exact_depths(u, v, triangle, hit, rotation, origin, focal, u0, v0, normals, offsets):
    """Depths (n,) float64 in m of the hits: the ray against the triangle's plane; inf if none.

    `hit` (n,) float32 is the caster's own depth, kept where the ray grazes the plane.
    """
    depth = np.empty(len(u), dtype=np.float64)
    for i in range(len(u)):
        t = triangle[i]
        if t < 0:
            depth[i] = np.inf
            continue
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        slope, start = 0.0, offsets[t]
        for axis in range(3):
            normal = normals[t, axis]
            slope += normal * (rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2])
            start -= normal * origin[axis]
        depth[i] = hit[i]
        if abs(slope) > 1e-9:
            exact = start / slope
            if abs(exact - hit[i]) < 1e-3 * hit[i]:
                depth[i] = exact
    return depth


@njit(cache=True, nogil=True)
def sun_rays(u, v, depth, triangle, rotation, origin, focal, u0, v0, normals, sun):
    """Rays (m, 6) float32 from the hits that face the sun towards it, and their samples (m,).

    `sun` (3,) is the unit vector towards the sun. A back face counts as if it were turned round.
    """
    rays = np.empty((len(u), 6), dtype=np.float32)
    which = np.empty(len(u), dtype=np.int64)
    count = 0
    direction = np.empty(3)
    for i in range(len(u)):
        t = triangle[i]
        if t < 0:
            continue
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        towards, facing = 0.0, 0.0
        for axis in range(3):
            direction[axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2]
            towards += normals[t, axis] * sun[axis]
            facing += normals[t, axis] * direction[axis]
        side = -1.0 if facing > 0.0 else 1.0
        if towards * side <= 0.0:
            continue
        for axis in range(3):
            rays[count, axis] = (
                origin[axis] + depth[i] * direction[axis] + SHADOW_OFFSET * side * normals[t, axis]
            )
            rays[count, 3 + axis] = sun[axis]
        which[count] = i
        count += 1
    return rays[:count], which[:count]


@njit(cache=True, nogil=True)
def moved_rays(rays, transform):
    """Rays (n, 6) float32 in the frame that `transform` (4, 4) leads to."""
    moved = np.empty_like(rays)
    for i in range(len(rays)):
        for axis in range(3):
            point, direction = transform[axis, 3], 0.0
            for k in range(3):
                point += transform[axis, k] * rays[i, k]
                direction += transform[axis, k] * rays[i, 3 + k]
            moved[i, axis], moved[i, 3 + axis] = point, direction
    return moved


@njit(cache=True, nogil=True, error_model="numpy")
def _bilinear(texels, decode, start, width, height, s, t):
    """The colour (red, green, blue) at (s, t) texels of a level that repeats."""
    column, row = np.floor(s - 0.5), np.floor(t - 0.5)
    a, b = np.float32(s - 0.5 - column), np.float32(t - 0.5 - row)
    left, top = np.int64(column) & (width - 1), np.int64(row) & (height - 1)
    right, bottom = (left + 1) & (width - 1), (top + 1) & (height - 1)
    upper, lower = start + top * width, start + bottom * width
    i00, i10, i01, i11 = upper + left, upper + right, lower + left, lower + right
    one = np.float32(1.0)
    w00, w10, w01, w11 = (one - a) * (one - b), a * (one - b), (one - a) * b, a * b
    return (
        w00 * decode[texels[i00, 0]]
        + w10 * decode[texels[i10, 0]]
        + w01 * decode[texels[i01, 0]]
        + w11 * decode[texels[i11, 0]],
        w00 * decode[texels[i00, 1]]
        + w10 * decode[texels[i10, 1]]
        + w01 * decode[texels[i01, 1]]
        + w11 * decode[texels[i11, 1]],
        w00 * decode[texels[i00, 2]]
        + w10 * decode[texels[i10, 2]]
        + w01 * decode[texels[i01, 2]]
        + w11 * decode[texels[i11, 2]],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _filtered(texels, decode, levels, first, past, s, t, sx, tx, sy, ty):
    """The texture's colour round (s, t), averaged over a pixel's footprint.

    (sx, tx) and (sy, ty) are the steps of (s, t) to the next pixel, in texture widths. The
    footprint is taken as an ellipse: mip-maps blur by its short axis, probes along its long axis do
    the rest, so a road seen at a grazing angle neither shimmers nor loses its texture across.
    """
    width, height = levels[first, 1], levels[first, 2]
    sx, sy, tx, ty = sx * width, sy * width, tx * height, ty * height
    a, b, c = sx * sx + sy * sy, sx * tx + sy * ty, tx * tx + ty * ty
    middle, half = 0.5 * (a + c), np.sqrt(0.25 * (a - c) * (a - c) + b * b)
    longest = np.sqrt(middle + half)
    shortest = np.sqrt(max(middle - half, 0.0))
    # The unit vector of the long axis: the better conditioned of the two columns.
    if a >= c:
        along_s, along_t = middle + half - c, b
    else:
        along_s, along_t = b, middle + half - a
    norm = np.sqrt(along_s * along_s + along_t * along_t)
    if norm > 0.0:
        along_s, along_t = along_s / norm / width, along_t / norm / height
    shortest = max(shortest, longest / MOST_PROBES, 1e-6)
    probes = 1
    if longest > 1.0:
        probes = min(int(np.ceil(longest / max(shortest, 1.0) - 1e-6)), MOST_PROBES)
    level = min(max(np.log2(shortest), 0.0), np.float64(past - first - 1))
    lower = first + int(level)
    blend = np.float32(level - int(level))
    upper = min(lower + 1, past - 1)
    near_start, near_width, near_height = levels[lower, 0], levels[lower, 1], levels[lower, 2]
    far_start, far_width, far_height = levels[upper, 0], levels[upper, 1], levels[upper, 2]
    red = green = blue = np.float32(0.0)
    for probe in range(probes):
        shift = ((probe + 0.5) / probes - 0.5) * longest
        p, q = s + shift * along_s, t + shift * along_t
        near = _bilinear(
            texels, decode, near_start, near_width, near_height, p * near_width, q * near_height
        )
        far = near
        if blend > 0.0:
            far = _bilinear(
                texels, decode, far_start, far_width, far_height, p * far_width, q * far_height
            )
        red += near[0] + blend * (far[0] - near[0])
        green += near[1] + blend * (far[1] - near[1])
        blue += near[2] + blend * (far[2] - near[2])
    share = np.float32(1.0 / probes)
    return red * share, green * share, blue * share


@njit(cache=True, nogil=True, error_model="numpy")
def shade(
    u,
    v,
    depth,
    triangle,
    lit,
    spread,
    rotation,
    origin,
    focal,
    u0,
    v0,
    normals,
    uv_gradients,
    texture,
    texels,
    decode,
    levels,
    first_level,
    sun,
    sunlight,
    skylight,
    groundlight,
):
    """Linear light (n, 3) float32 of hits: Lambert's law, textured; zeros where there is no hit.

    Args:
        u, v, depth, triangle: (n,) samples and what they hit.
        lit: (n,) bool, whether the sun is seen from there.
        spread: width of the area that one sample stands for, px.
        sun: (3,) towards the sun.
        sunlight, skylight, groundlight: (3,) light of the sun, the sky above, the ground below.
        rotation, origin, focal, u0, v0: the camera.
        normals, uv_gradients, texture, texels, decode, levels, first_level: as in `Surfaces`.
    """
    light = np.zeros((len(u), 3), dtype=np.float32)
    step = spread / focal
    # Columns of the rotation: the camera's right, down and forward. Written out in coordinates,
    # for small arrays cost more than what is computed with them.
    rx, ry, rz = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    dx, dy, dz = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    fx, fy, fz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    for i in range(len(u)):
        t = triangle[i]
        if t < 0:
            continue
        x, y, z = (u[i] - u0) / focal, (v[i] - v0) / focal, depth[i]
        ax, ay, az = rx * x + dx * y + fx, ry * x + dy * y + fy, rz * x + dz * y + fz
        nx, ny, nz = normals[t, 0], normals[t, 1], normals[t, 2]
        slope = nx * ax + ny * ay + nz * az
        side = -1.0 if slope > 0.0 else 1.0
        if abs(slope) < 1e-4:
            slope = -1e-4 * side
        # Steps of the hit, in its plane, to the next sample on the right and below.
        back = (nx * rx + ny * ry + nz * rz) / slope
        reach = z * step
        sx, sy, sz = reach * (rx - ax * back), reach * (ry - ay * back), reach * (rz - az * back)
        back = (nx * dx + ny * dy + nz * dz) / slope
        tx, ty, tz = reach * (dx - ax * back), reach * (dy - ay * back), reach * (dz - az * back)
        px, py, pz = origin[0] + z * ax, origin[1] + z * ay, origin[2] + z * az
        g00, g01, g02 = uv_gradients[t, 0, 0], uv_gradients[t, 0, 1], uv_gradients[t, 0, 2]
        g10, g11, g12 = uv_gradients[t, 1, 0], uv_gradients[t, 1, 1], uv_gradients[t, 1, 2]
        red, green, blue = _filtered(
            texels,
            decode,
            levels,
            first_level[texture[t]],
            first_level[texture[t] + 1],
            g00 * px + g01 * py + g02 * pz + uv_gradients[t, 0, 3],
            g10 * px + g11 * py + g12 * pz + uv_gradients[t, 1, 3],
            g00 * sx + g01 * sy + g02 * sz,
            g10 * sx + g11 * sy + g12 * sz,
            g00 * tx + g01 * ty + g02 * tz,
            g10 * tx + g11 * ty + g12 * tz,
        )
        direct = 0.0
        if lit[i]:
            direct = max((nx * sun[0] + ny * sun[1] + nz * sun[2]) * side, 0.0)
        above = 0.5 + 0.5 * nz * side
        below = 1.0 - above
        light[i, 0] = red * (direct * sunlight[0] + above * skylight[0] + below * groundlight[0])
        light[i, 1] = green * (direct * sunlight[1] + above * skylight[1] + below * groundlight[1])
        light[i, 2] = blue * (direct * sunlight[2] + above * skylight[2] + below * groundlight[2])
    return light


@njit(cache=True, nogil=True)
def sky_light(u, v, rotation, focal, u0, v0, zenith, horizon):
    """Linear light (n, 3) float32 of the sky in the samples' directions; frames with z up."""
    light = np.empty((len(u), 3), dtype=np.float32)
    for i in range(len(u)):
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        upwards = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2]
        height = max(upwards / np.sqrt(x * x + y * y + 1.0), 0.0)
        share = 1.0 - (1.0 - height) ** 4
        for channel in range(3):
            light[i, channel] = horizon[channel] + share * (zenith[channel] - horizon[channel])
    return light
