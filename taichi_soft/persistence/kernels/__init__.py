"""Kernels that pack and hash the state of a world between two steps."""
