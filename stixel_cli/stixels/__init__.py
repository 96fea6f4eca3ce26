"""From disparity to stixels: road, occupancy grid, free space, height, extraction.

Conventions: `columns` (W, H) int16 are raw disparities, column by column, `count` is the number of
disparities searched, and `line` (2,) is the road's disparity a v + b in row v, px.
"""
