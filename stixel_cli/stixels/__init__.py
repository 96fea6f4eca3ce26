"""From disparity to stixels: road, occupancy grid, free space, height, extraction."""
