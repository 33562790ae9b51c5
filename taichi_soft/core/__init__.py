"""The ground: errors, checks, types, the one start of Taichi, and bytes. Knows nothing of bodies."""
