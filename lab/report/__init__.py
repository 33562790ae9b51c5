"""Experiments as a page, as files of numbers, and on the terminal."""
