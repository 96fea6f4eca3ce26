"""The page of `stixel assess`."""

from stixel_cli.pictures import style
from stixel_cli.report.assess import LABELS, PICTURES, Assessment, page_html, sentences


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


def test_pictures_are_not_shown_smaller_than_their_text_is_legible():
    html = page_html(found(), "stixel assess")
    # 440 px wide, with letters of 8 points at 110 dpi.
    assert html.count('style="min-width: 360px"') == len(PICTURES)
