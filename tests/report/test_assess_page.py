"""The page of `stixel assess`."""

import io

import numpy as np
from made_stixels import made_stixels
from PIL import Image

from stixel_cli.pictures import style
from stixel_cli.report.assess import LABELS, PICTURES, Assessment, error_map, page_html, sentences
from stixel_cli.validation.pair_errors import AreaErrors


def found(**values):
    with style.drawing():
        png = style.png(style.new_figure(4.0, 1.0))
    known = {"stixel_share": 0.8, "free_share": 0.1, "unknown_share": 0.1}
    return Assessment(
        dict.fromkeys(LABELS) | known | values, dict.fromkeys(dict(PICTURES), png), {"match": 0.1}
    )


def test_without_a_near_obstacle_no_column_is_counted():
    assert sentences(found(near_columns=0, near_called_free=0))[0].startswith("No true obstacle")
    assert sentences(found(near_columns=5, near_called_free=0))[0].startswith("0 of 5 columns")


def test_all_stixels_come_before_those_on_square_surfaces():
    known = {"median_px": 0.69, "beyond_1px_share": 0.408, "stixels_compared": 355}
    square = {"square_median_px": 0.15, "square_beyond_1px_share": 0.046, "square_compared": 65}
    first = sentences(found(**known, **square, obstacle_covered_share=0.9))[0]
    assert first.startswith(
        "Of 355 stixels with a true disparity, 40.8 % are off by more than 1 px"
    )
    assert "On square surfaces these are 4.6 % and 0.15 px (65 stixels)." in first
    assert "square" not in sentences(found(**known, square_compared=0))[0]


def test_the_error_map_colours_a_stixel_by_its_error():
    stixels = made_stixels(left=[2, 12], right=[8, 18], top=[2, 2], base=[12, 12])
    errors = AreaErrors(np.array([1]), np.array([2.5]), np.zeros(1), np.array([10.0]))
    image = np.full((16, 24), 100, dtype=np.uint8)
    png = error_map(image, stixels, errors)
    red, green, _ = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int).reshape(-1, 3).T
    # The stixel that is 2.5 px too near is red, far beyond the end of the colour bar.
    assert np.mean((red > 150) & (green < 80)) > 0.05
    none = AreaErrors(np.zeros(0, int), *np.zeros((3, 0)))
    png = error_map(image, stixels, none)
    red, green, _ = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int).reshape(-1, 3).T
    assert np.mean((red > 150) & (green < 80)) < 0.02


def test_pictures_are_not_shown_smaller_than_their_text_is_legible():
    html = page_html(found(), "stixel assess")
    # 440 px wide, with letters of 8 points at 110 dpi.
    assert html.count('style="min-width: 360px"') == len(PICTURES)
