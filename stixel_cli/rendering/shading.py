"""Compiled kernels of the ray caster that compute light: filtered textures, sun and sky.

A sample is a point (u, v) in px on the image of a camera, given by `rotation` (3, 3) from the
camera to the frame, `origin` (3,) m, `focal`, `u0`, `v0` px. Directions have depth 1 along the
optical axis, so a ray's parameter is the depth in m. All is in one frame, that of the body in
question.

The callers make the arrays that kernels write: Numba compiles an allocation as slowly as a loop.
"""

import numpy as np
from numba import njit

MOST_PROBES = 16
"""At most this many look-ups along a footprint's long axis; a longer footprint gets blurred."""

RED, GREEN, FIELD = np.uint64(42), np.uint64(21), np.uint64((1 << 21) - 1)
"""A packed colour is three fields of 21 bits: 13 of a texel and 8 of the weights of four."""

TEXEL_STEP = 1.0 / 8191.0
"""Linear light of one step of a packed texel."""


@njit(inline="always")
def _bilinear(texels, start, width, height, s, t):
    """The packed colour, times 256, at (s, t) of a level that repeats; 65536 is one texel."""
    left, top = (s >> 16) & (width - 1), (t >> 16) & (height - 1)
    right, bottom = (left + 1) & (width - 1), (top + 1) & (height - 1)
    upper, lower = start + top * width, start + bottom * width
    a, b = (s >> 8) & 255, (t >> 8) & 255
    both = (a * b + 128) >> 8
    # The weights are whole and add up to 256, so no field of the packed sum runs over.
    return (
        texels[np.uint64(upper + left)] * np.uint64(256 - a - b + both)
        + texels[np.uint64(upper + right)] * np.uint64(a - both)
        + texels[np.uint64(lower + left)] * np.uint64(b - both)
        + texels[np.uint64(lower + right)] * np.uint64(both)
    )


@njit(inline="always")
def _filtered(textures, texture, place, right, below, finer):
    """The colour of a texture round a `place` (s, t), averaged over a pixel's footprint.

    `right` and `below` are the steps of (s, t) to the next pixel, in texture widths. The
    footprint is taken as an ellipse: mip-maps blur by its short axis over `finer`, probes along
    both axes do the rest, so a road seen at a grazing angle neither shimmers nor loses its texture
    across.
    """
    texels, levels, first_level = textures
    first, past = first_level[texture], first_level[texture + 1]
    (s, t), width, height = place, levels[first, 1], levels[first, 2]
    sx, sy, tx, ty = right[0] * width, below[0] * width, right[1] * height, below[1] * height
    a, b, c = sx * sx + sy * sy, sx * tx + sy * ty, tx * tx + ty * ty
    middle, half = 0.5 * (a + c), np.sqrt(0.25 * (a - c) * (a - c) + b * b)
    longest = np.sqrt(middle + half)
    shortest = np.sqrt(max(middle - half, 0.0))
    # The unit vector of the long axis: the better conditioned of the two columns.
    along_s, along_t = (middle + half - c, b) if a >= c else (b, middle + half - a)
    norm = np.sqrt(along_s * along_s + along_t * along_t)
    across_s = across_t = 0.0
    if norm > 0.0:
        along_s, along_t = along_s / norm, along_t / norm
        across_s, across_t = -along_t / width, along_s / height
        along_s, along_t = along_s / width, along_t / height
    shortest = max(shortest, longest / MOST_PROBES, 1e-6)
    rows = finer if shortest > 1.0 else 1
    fine = shortest / rows
    probes = 1
    if longest > 1.0:
        probes = min(int(np.ceil(longest / max(fine, 1.0) - 1e-6)), rows * MOST_PROBES)
    level = min(max(np.log2(fine), 0.0), np.float64(past - first - 1))
    lower = first + int(level)
    blend = level - int(level)
    upper = min(lower + 1, past - 1)
    step = longest / probes
    begin = -0.5 * step * (probes - 1)
    red = green = blue = 0.0
    for k in range(2):
        number, share = (lower, 1.0 - blend) if k == 0 else (upper, blend)
        if share == 0.0:
            continue
        start, width, height = levels[number, 0], levels[number, 1], levels[number, 2]
        # Whole numbers from here on, 65536 to a texel.
        step_p = np.int64(step * along_s * width * 65536.0)
        step_q = np.int64(step * along_t * height * 65536.0)
        reds = greens = blues = np.uint64(0)
        for row in range(rows):
            aside = (row - 0.5 * (rows - 1)) * fine
            at_s = s + begin * along_s + aside * across_s
            at_t = t + begin * along_t + aside * across_t
            p = np.int64(np.floor((at_s * width - 0.5) * 65536.0))
            q = np.int64(np.floor((at_t * height - 0.5) * 65536.0))
            for _ in range(probes):
                packed = _bilinear(texels, start, width, height, p, q)
                reds += packed >> RED
                greens += (packed >> GREEN) & FIELD
                blues += packed & FIELD
                p += step_p
                q += step_q
        red += share * reds
        green += share * greens
        blue += share * blues
    share = TEXEL_STEP / 256.0 / (probes * rows)
    return red * share, green * share, blue * share


@njit(cache=True, nogil=True, error_model="numpy")
def shade(light, samples, pinhole, planes, textures, suns):
    """Write the linear light of the hits on one body: Lambert's law, textured.

    Args:
        light: (n, 3) float32, written where the body is hit.
        samples: hits, as in `Hits`; lit (n,) bool, whether the sun is seen from there; spread (n,)
            float64, width of the square that a sample represents, px; index of the body; finer:
            probes along the short axis of a footprint. The grid of a mip-map is not that of the
            pixels; the smaller its texels, the less do two cameras see different textures.
        pinhole: of the camera.
        planes: normals, uv_gradients, texture, as in `Surfaces`.
        textures: texels, levels, first_level, as in `Textures`.
        suns: (3,) each: towards the sun; light of the sun, of the sky above, of the ground below.
    """
    (u, v, depth, body, triangle), lit, spread, index, finer = samples
    rotation, origin, focal, u0, v0 = pinhole
    normals, uv_gradients, texture = planes
    sun, sunlight, skylight, groundlight = suns
    inverse = 1.0 / focal
    # Columns of the rotation: the camera's right, down and forward. Written out in coordinates,
    # for small arrays cost more than what is computed with them.
    rx, ry, rz = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    dx, dy, dz = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    fx, fy, fz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    for i in range(len(u)):
        if body[i] != index:
            continue
        t = triangle[i]
        x, y, z = (u[i] - u0) * inverse, (v[i] - v0) * inverse, depth[i]
        ax, ay, az = rx * x + dx * y + fx, ry * x + dy * y + fy, rz * x + dz * y + fz
        nx, ny, nz = normals[t, 0], normals[t, 1], normals[t, 2]
        slope = nx * ax + ny * ay + nz * az
        side = -1.0 if slope > 0.0 else 1.0
        if abs(slope) < 1e-4:
            slope = -1e-4 * side
        # Steps of the hit, in its plane, to the next sample on the right and below.
        back = (nx * rx + ny * ry + nz * rz) / slope
        reach = z * spread[i] * inverse
        sx, sy, sz = reach * (rx - ax * back), reach * (ry - ay * back), reach * (rz - az * back)
        back = (nx * dx + ny * dy + nz * dz) / slope
        tx, ty, tz = reach * (dx - ax * back), reach * (dy - ay * back), reach * (dz - az * back)
        px, py, pz = origin[0] + z * ax, origin[1] + z * ay, origin[2] + z * az
        g00, g01, g02 = uv_gradients[t, 0, 0], uv_gradients[t, 0, 1], uv_gradients[t, 0, 2]
        g10, g11, g12 = uv_gradients[t, 1, 0], uv_gradients[t, 1, 1], uv_gradients[t, 1, 2]
        at_s = g00 * px + g01 * py + g02 * pz + uv_gradients[t, 0, 3]
        at_t = g10 * px + g11 * py + g12 * pz + uv_gradients[t, 1, 3]
        to_right = g00 * sx + g01 * sy + g02 * sz, g10 * sx + g11 * sy + g12 * sz
        to_below = g00 * tx + g01 * ty + g02 * tz, g10 * tx + g11 * ty + g12 * tz
        red, green, blue = _filtered(textures, texture[t], (at_s, at_t), to_right, to_below, finer)
        direct = 0.0
        if lit[i]:
            direct = max((nx * sun[0] + ny * sun[1] + nz * sun[2]) * side, 0.0)
        above = 0.5 + 0.5 * nz * side
        below = 1.0 - above
        light[i, 0] = red * (direct * sunlight[0] + above * skylight[0] + below * groundlight[0])
        light[i, 1] = green * (direct * sunlight[1] + above * skylight[1] + below * groundlight[1])
        light[i, 2] = blue * (direct * sunlight[2] + above * skylight[2] + below * groundlight[2])


@njit(cache=True, nogil=True, error_model="numpy")
def sky_light(light, hits, pinhole, stretch, sky):
    """Write the linear light of the sky into `light` (n, 3) float32 where no body is hit.

    The camera's `pinhole` and `stretch` are those in a frame with z up; `sky` is the light (3,) of
    the zenith, and that of the horizon.
    """
    u, v, _, body, _ = hits
    rotation, _, focal, u0, v0 = pinhole
    zenith, horizon = sky
    for i in range(len(u)):
        if body[i] >= 0:
            continue
        x, y = (u[i] - u0) / focal, (v[i] - v0) / focal
        upwards = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2]
        height = max(upwards / np.sqrt(x * x + y * y * stretch**2 + 1.0), 0.0)
        share = 1.0 - (1.0 - height) ** 4
        for channel in range(3):
            light[i, channel] = horizon[channel] + share * (zenith[channel] - horizon[channel])
