"""By how much two results differ, in words."""

import dataclasses

import numpy as np
import pytest

from stixel_cli.results.lineage import first_difference


@dataclasses.dataclass(frozen=True)
class Noun:
    values: np.ndarray
    name: str = "a"


def test_what_is_the_same():
    values = np.array([1.0, np.nan, -0.0])
    for one in (Noun(values), {"a": values}, [values], 3, float("nan"), b"x", None):
        assert first_difference(one, one) is None
    assert first_difference(Noun(values), Noun(values.copy())) is None
    assert first_difference(float("nan"), float("nan")) is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (np.zeros(3), np.array([0.0, 0.5, -2.0]), "2 of 3 values differ, by up to 2"),
        (np.zeros(3), np.zeros(4), "its shape (3,) became (4,)"),
        (np.zeros(3), np.zeros(3, np.float32), "its type float64 became float32"),
        (np.zeros(1), np.array([np.nan]), "1 of 1 values differ, not finite"),
        (np.zeros(1), np.array([-0.0]), "zeros of other signs"),
        (np.array([True]), np.array([False]), "1 of 1 values differ, by up to 1"),
        (np.array([0], np.uint8), np.array([255], np.uint8), "by up to 255"),
        (Noun(np.zeros(2)), Noun(np.ones(2)), "values: 2 of 2 values differ, by up to 1"),
        (Noun(np.zeros(1)), Noun(np.zeros(1), "b"), "name: 'a' became 'b'"),
        ({"a": 1}, {"b": 1}, "a is in only one of the two"),
        ([1, [2, 3]], [1, [2, 4]], "1.1: 3 became 4"),
        (1, 1.0, "a int became a float"),
        (b"one", b"two", "other bytes"),
    ],
)
def test_what_differs(old, new, said):
    assert said in first_difference(old, new)
    assert first_difference(old, new, "it").startswith("it")
