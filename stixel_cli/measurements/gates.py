"""The gates of height and range that two kinds of measurement share."""


def check_gates(height_min: float, height_max: float, range_min: float, range_max: float) -> None:
    """Raise ValueError unless both gates of the group `measurement` are open; all in m."""
    if height_max <= height_min:
        raise ValueError(
            f"measurement.height_max: {height_max} m is not above measurement.height_min, "
            f"{height_min} m"
        )
    if range_max <= range_min:
        raise ValueError(
            f"measurement.range_max: {range_max} m is not above measurement.range_min, "
            f"{range_min} m"
        )
