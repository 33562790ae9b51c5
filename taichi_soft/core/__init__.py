"""Foundation of the package: errors, checks, types, the start of Taichi, and serialisation.

No module in this folder depends on bodies.
"""
