"""Schema of the group `pace`, from which the presets of conf/path/ take their values.

Positions are in the world frame: the ego car's ground plane at k = 0, x right, y forward, m.
Headings are in degrees, counter-clockwise from +x.
"""

from typing import Annotated

from annotated_types import Ge, Le, Len

from stixel_cli.parameters import parameters
from stixel_cli.scene.path_parameters import Degrees, Duration, Point, Radius, Speed


@parameters
class Stretch:
    """Where and how long a road user of some class is on one of the preset paths.

    Attributes:
        start: first position, m.
        heading: first heading, degrees.
        duration: s.
    """

    start: Point
    heading: Degrees
    duration: Duration


@parameters
class Pace:
    """Credible speeds of a class of road user, and preset paths that keep it in view.

    Read only by interpolation from conf/path/*.yaml, so that a path follows the class.

    Attributes:
        speed: ordinary speed, m/s.
        turn_speed: speed in a tight turn, m/s.
        turn_radius: radius of the preset turn, m.
        wavelength: length of one swing to both sides on the preset S-curve, m.
        points: the preset waypoints, m.
        points_duration: time on the preset waypoints, s.
        approach, depart, crossing, turn, s_curve, stop_and_go, circle: start of each preset path.
    """

    speed: Speed
    turn_speed: Speed
    turn_radius: Radius
    wavelength: Annotated[float, Ge(1), Le(1000)]
    points: Annotated[tuple[Point, ...], Len(2, 1000)]
    points_duration: Duration
    approach: Stretch
    depart: Stretch
    crossing: Stretch
    turn: Stretch
    s_curve: Stretch
    stop_and_go: Stretch
    circle: Stretch
