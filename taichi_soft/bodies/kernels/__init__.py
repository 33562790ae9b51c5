"""Kernels over the particles and faces of one body."""
