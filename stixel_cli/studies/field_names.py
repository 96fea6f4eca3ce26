"""What the field calls the measurements and the trackers that studies compare."""

from stixel_cli.config.schema import Configuration

STIXELS, LIDAR, BASELINE = "simulated", "lidar", "point"
"""Kinds of measurement and of tracker that the questions name."""


def measurement_name(option: str, configuration: Configuration) -> str:
    """What the field calls a measurement: stixels, fabricated rays, a lidar of so many layers."""
    measurement = configuration.measurement
    if measurement.kind == LIDAR:
        return f"{measurement.scanner.layers}-layer lidar"
    return {STIXELS: "stixels", "fabricated": "fabricated rays"}.get(measurement.kind, option)


def tracker_name(option: str, configuration: Configuration) -> str:
    """What the field calls a tracker; one without a name of its own is called as its option."""
    return {"gp_ekf": "GP-EKF", BASELINE: "point tracker"}.get(configuration.tracker.kind, option)
