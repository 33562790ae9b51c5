"""Signed distances of points from solids."""
