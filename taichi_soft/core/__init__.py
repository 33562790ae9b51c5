"""Foundation of the package, which knows no bodies: errors, checks, types, the start of Taichi,
serialisation.
"""
