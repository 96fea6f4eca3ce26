"""A car: body with wheel arches, cabin with windows, wheels, lamps, mirrors.

Modelled as a hatchback of 4.5 × 1.8 × 1.5 m, x forward, y left, z up. Other bodies differ from it
as their `CarShape` states.
"""

from dataclasses import dataclass

import numpy as np

from stixel_cli.scene import shapes
from stixel_cli.scene.mesh import Mesh, Part, scaled
from stixel_cli.scene.textures import Colour, mottled, paint


@dataclass(frozen=True)
class CarShape:
    """One car's body."""

    length: float
    width: float
    """`length`, `width`: outer size with mirrors, m."""
    roof: float = 0.0
    """How much higher the roof is than the hatchback's, m."""
    lift: float = 0.0
    """How much higher the flanks are, as a share of their height."""
    windscreen_foot: float = 0.0
    windscreen_top: float = 0.0
    """`windscreen_foot`, `windscreen_top`: how much farther in front the windscreen's lower and
    upper edges are, m on the hatchback's scale."""
    roof_end: float = 0.0
    tail: float = 0.0
    """`roof_end`, `tail`: the same for the roof's rear edge and the rear window's lower edge."""
    fullness: float = 1.0
    """1 for the hatchback's corners seen from above, more for rounder ones."""

    @property
    def stretch(self) -> float:
        """Length over that of the hatchback."""
        return self.length / STANDARD.length


STANDARD = CarShape(length=4.5, width=1.8)

_BODIES = {
    # length, height, lift, windscreen's foot and top, roof's end, tail: from … to
    "small": ((3.6, 4.1), (1.42, 1.56), (0.0, 0.08), (0.0, 0.2), (0.0, 0.2), (-0.4, 0.0),
              (0.0, 0.0)),
    "hatchback": ((4.0, 4.5), (1.42, 1.52), (0.0, 0.06), (-0.1, 0.1), (-0.1, 0.1), (-0.1, 0.2),
                  (0.0, 0.0)),
    "saloon": ((4.4, 5.05), (1.38, 1.50), (0.0, 0.05), (-0.1, 0.1), (-0.1, 0.1), (0.4, 0.7),
               (0.3, 0.5)),
    "estate": ((4.3, 5.0), (1.42, 1.54), (0.0, 0.06), (-0.1, 0.1), (-0.1, 0.1), (-0.55, -0.35),
               (0.0, 0.0)),
    "off-road": ((4.1, 4.9), (1.60, 1.80), (0.12, 0.24), (-0.1, 0.1), (-0.1, 0.2), (-0.5, -0.2),
                 (0.0, 0.0)),
    "van": ((4.2, 5.05), (1.75, 1.98), (0.10, 0.20), (0.3, 0.5), (0.5, 0.9), (-0.65, -0.45),
            (0.0, 0.0)),
}  # fmt: skip


def drawn(random: np.random.Generator) -> CarShape:
    """A car's body: one of six kinds, then its measures; longer cars are wider.

    Length 3.6 … 5.1 m, width 1.6 … 2.0 m, height 1.38 … 1.98 m.
    """
    kind = list(_BODIES)[random.integers(len(_BODIES))]
    length, height, lift, foot, top, roof_end, tail = (
        float(random.uniform(*limits)) for limits in _BODIES[kind]
    )
    width = 1.64 + 0.28 * (length - 3.6) / 1.5 + 0.06 * float(random.uniform(-0.6, 1.3))
    fullness = float(random.uniform(0.7, 1.4))
    return CarShape(length, width, height - 1.5, lift, foot, top, roof_end, tail, fullness)


WHEEL_X = (1.37, -1.30)
WHEEL_Y = 0.70
WHEEL_RADIUS = 0.32
ARCH_RADIUS = 0.385

_TOP = (
    (-2.25, -2.20, -2.05, -1.60, 0.00, 0.95, 1.30, 1.80, 2.08, 2.20, 2.25),
    (0.62, 0.86, 0.94, 0.96, 0.94, 0.93, 0.89, 0.81, 0.72, 0.60, 0.50),
)
_SILL = (
    (-2.25, -2.15, -1.90, -1.00, 1.00, 1.90, 2.15, 2.25),
    (0.42, 0.30, 0.24, 0.2, 0.2, 0.2, 0.25, 0.36),
)
_HALF_WIDTH = (
    (-2.25, -2.21, -2.08, -1.80, -1.20, 1.20, 1.75, 2.05, 2.19, 2.25),
    (0.48, 0.63, 0.755, 0.805, 0.83, 0.83, 0.80, 0.73, 0.62, 0.45),
)
# Height (share of sill to top) and breadth (share of the half width) of a cross-section, upwards.
_SECTION = (
    np.array([0.0, 0.06, 0.30, 0.58, 0.80, 0.93, 1.0]),
    np.array([0.90, 0.965, 0.99, 1.0, 0.985, 0.95, 0.86]),
)


limbs = None


def mesh(contrast: float, shape: CarShape = STANDARD, colour: Colour = (66, 108, 160)) -> Mesh:
    """The car, its paint of `contrast` 0 … 1 and of `colour`."""
    painted = paint(colour, contrast)
    shell, windows = _cabin(painted, shape)
    trim = mottled("trim", (34, 34, 37), 0.20)
    underbody = shapes.box((-2.02, -0.60, 0.24), (2.05, 0.60, 0.66))
    raised = np.array([0.0, 0.0, 0.4 * shape.lift])
    parts = (
        shapes.part("body", [_body(shape), *_mirrors(shape), *_handles(shape)], painted, 1.1),
        shell,
        windows,
        shapes.part("trim", [underbody, *_seams(shape), *_grilles()], trim, 0.5),
        shapes.part("tyres", [_tyre(x, y) for x in WHEEL_X for y in (1, -1)], trim, 0.4),
        shapes.part("rims", _rims(), mottled("alloy", (176, 178, 184), 0.12), 0.3),
        shapes.part(
            "headlamps", _lamps(np.add(raised, (2.065, 0.585, 0.645)), (0.12, 0.15, 0.075)),
            mottled("headlamp", (238, 240, 245), 0.05), 0.2),
        shapes.part(
            "tail lamps", _lamps(np.add(raised, (-2.135, 0.605, 0.80)), (0.07, 0.11, 0.09)),
            mottled("tail lamp", (176, 18, 22), 0.12), 0.2),
        shapes.part("plates", [shapes.box((2.225, -0.26, 0.385), (2.258, 0.26, 0.49)),
                               shapes.box((-2.262, -0.26, 0.64), (-2.225, 0.26, 0.75))],
                    mottled("plate", (228, 228, 220), 0.10), 0.3),
    )  # fmt: skip
    stretched = scaled(parts, np.array([shape.stretch, shape.width / STANDARD.width, 1.0]))
    for one, own in zip(stretched, parts, strict=True):
        # Wheels move along, and stay round.
        if one.name in ("tyres", "rims"):
            x = own.vertices[:, 0]
            one.vertices[:, 0] = x + (shape.stretch - 1.0) * np.where(x > 0.0, *WHEEL_X)
    return stretched


def _top(x, shape):
    """Upper edge of the flank at `x`, m."""
    top = shapes.monotone(_TOP, x)
    return top + shape.lift * (top - shapes.monotone(_SILL, x))


def _half_width(x, shape):
    """Half of the body's breadth at `x`, m: more rounded in plan where `fullness` is above 1."""
    breadth = shapes.monotone(_HALF_WIDTH, x)
    return breadth * (breadth / 0.83) ** (shape.fullness - 1.0)


def _body(shape):
    reach = ARCH_RADIUS / shape.stretch
    arches = [x + reach * np.cos(np.linspace(0.0, np.pi, 13)) for x in WHEEL_X]
    ends = [2.25, 2.23, 2.19, 2.13, 2.05, 1.95, -1.95, -2.05, -2.12, -2.17, -2.21, -2.235, -2.25]
    stations = np.unique(np.round(np.concatenate([*arches, ends, np.linspace(-0.85, 0.9, 8)]), 4))
    top, width = _top(stations, shape), _half_width(stations, shape)
    sill = shapes.monotone(_SILL, stations)
    for x in WHEEL_X:
        along = shape.stretch * (stations - x)
        lift = np.sqrt(np.maximum(ARCH_RADIUS**2 - along**2, 0.0))
        sill = np.maximum(sill, np.where(lift > 0.0, WHEEL_RADIUS + lift, 0.0))
    heights = sill[:, None] + (top - sill)[:, None] * _SECTION[0]
    breadths = width[:, None] * _SECTION[1]
    along = np.broadcast_to(stations[:, None], heights.shape)
    left = np.stack([along, breadths, heights], axis=-1)
    right = left[:, ::-1] * np.array([1.0, -1.0, 1.0])
    crown = np.stack([stations, np.zeros_like(stations), top + 0.025], axis=-1)[:, None]
    floor = np.stack([stations, np.zeros_like(stations), sill], axis=-1)[:, None]
    rings = np.concatenate([left, crown, right, floor], axis=1)
    return shapes.loft(rings)


def _cabin(painted: np.ndarray, shape: CarShape) -> tuple[Part, Part]:
    """The painted shell and the windows: columns of one loft over rounded rectangles."""
    per_side, per_corner = 12, 3
    levels = [
        # Of the hatchback: height, rear, front, half width, corner radius, m
        (0.88, -2.10, 1.13, 0.755, 0.10),
        (0.955, -2.06, 1.03, 0.745, 0.10),
        (1.17, -1.93, 0.66, 0.69, 0.10),
        (1.38, -1.72, 0.25, 0.625, 0.11),
        (1.45, -1.58, 0.06, 0.585, 0.13),
        (1.487, -1.40, -0.14, 0.52, 0.16),
    ]
    rings = []
    foot = 0.68 * shape.lift
    for height, rear, front, half, radius in levels:
        up = (height - 0.88) / 0.62
        # How far the rear and the front have come from the foot to the roof.
        behind, ahead = (rear + 2.10) / 0.70, (1.13 - front) / 1.27
        rear = rear + (1.0 - behind) * shape.tail + behind * shape.roof_end
        front = front + (1.0 - ahead) * shape.windscreen_foot + ahead * shape.windscreen_top
        height = height + (1.0 - up) * foot + up * shape.roof
        ring = shapes.rounded_rectangle((rear, -half), (front, half), radius, per_side, per_corner)
        rings.append(np.column_stack([ring, np.full(len(ring), height)]))
    rings = np.array(rings)
    points = rings.shape[1]
    middle = 0.5 * (shape.roof_end + shape.windscreen_top)
    roof = np.array([[-0.75 + middle, 0.0, 1.50 + shape.roof]])
    vertices = np.concatenate([rings.reshape(-1, 3), roof])
    quads = shapes.ring_quads(len(levels), points)
    # Columns run corner, side (left, rear, right, front), corner …; posts stay painted.
    place = np.arange(points) % (per_side + per_corner)
    side = np.arange(points) // (per_side + per_corner)
    glass = (place >= per_corner) & (place < per_side + per_corner)
    post = (side % 2 == 0) & (place - per_corner == 6)
    window = np.zeros(quads.shape[:2], dtype=bool)
    window[1:3] = glass & ~post
    last = points * (len(levels) - 1)
    ahead = np.arange(points)
    lid = np.column_stack(
        [last + ahead, last + (ahead + 1) % points, np.full(points, len(vertices) - 1)]
    )
    body = shapes.quads_to_triangles(quads)
    _, triangles = shapes.outward(vertices, np.concatenate([body, lid]))
    chosen = np.concatenate([np.repeat(window.reshape(-1), 2), np.zeros(points, dtype=bool)])

    def covered(name: str, rows: np.ndarray, texture: np.ndarray, tile: float) -> Part:
        kept = np.ascontiguousarray(triangles[rows])
        return Part(vertices, kept, shapes.cube_uvs(vertices, kept, tile), texture, name)

    glazing = mottled("glass", (48, 58, 66), 0.20)
    return covered("cabin", ~chosen, painted, 1.1), covered("windows", chosen, glazing, 1.6)


def _side(x, share, shape):
    """Points (n, 3) on the left flank at `x` and at the share of the height from sill to top."""
    breadth = np.interp(share, *_SECTION)
    sill = shapes.monotone(_SILL, x)
    height = sill + share * (_top(x, shape) - sill)
    return np.stack([x, _half_width(x, shape) * breadth, height], axis=-1)


def _both(points):
    return [points, points * np.array([1.0, -1.0, 1.0])]


def _seams(shape):
    """Dark joints about the doors, and rubbing strips along the flanks."""
    share, along = np.linspace(0.10, 0.99, 7), np.linspace(-0.84, 0.92, 9)
    joints = [_side(np.full_like(share, x), share, shape) for x in (0.80, -0.42, -1.02)]
    strips = _both(_side(along, np.full_like(along, 0.12), shape))
    return [
        *(shapes.tube(line, 0.008, 4) for joint in joints for line in _both(joint)),
        *(shapes.tube(line, 0.022, 6) for line in strips),
    ]


def _handles(shape):
    share = np.array([0.80, 0.80])
    handles = [_side(np.array([x, x + 0.17]), share, shape) for x in (-0.28, -0.90)]
    return [shapes.tube(line, 0.017, 6) for handle in handles for line in _both(handle)]


def _mirrors(shape):
    surfaces = []
    shift = np.array([0.5 * shape.windscreen_foot, 0.0, 0.7 * shape.lift])
    left = np.add(shift, [(0.70, 0.83, 1.01), (0.74, 0.70, 0.93), (0.71, 0.80, 0.98)])
    for points in _both(left):
        mirror = shapes.ellipsoid(points[0], (0.065, 0.07, 0.065), 6, 12)
        surfaces += [mirror, shapes.tube(points[1:], 0.022, 6)]
    return surfaces


def _grilles():
    return [
        shapes.box((2.02, -0.46, 0.27), (2.252, 0.46, 0.36)),
        shapes.box((2.02, -0.36, 0.52), (2.236, 0.36, 0.60)),
        shapes.box((-2.245, -0.50, 0.33), (-2.02, 0.50, 0.43)),
    ]


def _tyre(x: float, sign: int):
    profile = [(-0.105, 0.22), (-0.105, 0.27), (-0.085, 0.315), (-0.05, WHEEL_RADIUS),
               (0.05, WHEEL_RADIUS), (0.085, 0.315), (0.105, 0.27), (0.105, 0.22)]  # fmt: skip
    return shapes.lathe(profile, (x, sign * WHEEL_Y, WHEEL_RADIUS), 18)


def _rims():
    surfaces = []
    for x in WHEEL_X:
        for sign in (1, -1):
            centre = np.array([x, sign * (WHEEL_Y + 0.095), WHEEL_RADIUS])
            ring = [(-0.02, 0.185), (-0.02, 0.225), (0.012, 0.225), (0.012, 0.185)]
            hub = [(-0.02, 0.05), (0.013, 0.05), (0.017, 0.035)]
            surfaces += [shapes.hoop(ring, centre, 20), shapes.lathe(hub, centre, 12)]
            for spoke in range(5):
                angle = 2.0 * np.pi * spoke / 5 + 0.3
                reach = np.array([np.cos(angle), 0.0, np.sin(angle)])
                surfaces.append(shapes.tube([centre, centre + 0.20 * reach], [0.028, 0.02], 4))
    return surfaces


def _lamps(centre, radii):
    return [shapes.ellipsoid(place, radii, 6, 12) for place in _both(centre)]
