"""Loops over tetrahedra and edges: they load values, call laws, store forces."""
