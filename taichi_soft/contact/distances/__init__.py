"""Signed distances of points from the solids that bodies hit."""
