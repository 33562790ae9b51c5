"""Foundation of the package, independent of bodies: errors, checks, types, Taichi's start, serialisation."""
