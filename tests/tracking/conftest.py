import pytest
from tracking_cases import CAR, START, TRACKER


@pytest.fixture
def tracker():
    """What `track` takes after the scans: initial state, prior, parameters."""
    return START, CAR, TRACKER
