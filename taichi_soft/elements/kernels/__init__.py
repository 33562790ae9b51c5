"""Kernels over tetrahedra and edges: load values, call laws, store forces."""
