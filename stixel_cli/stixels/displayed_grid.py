"""The stage of the pictures' grid: the page's images, another stage, share its function."""

from stixel_cli.stixels.occupancy import picture_grid as picture_grid
