"""Kernels of a world file that replace Python code."""
