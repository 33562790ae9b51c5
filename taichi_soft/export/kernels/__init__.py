"""Kernels that a world file needs in place of Python code."""
