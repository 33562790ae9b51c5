"""What bodies hit: signed distances of points from solids."""
