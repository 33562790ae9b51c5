"""Bodies of more or fewer tetrahedra while they move."""
