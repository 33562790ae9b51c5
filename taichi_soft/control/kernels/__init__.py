"""Kernels that write control inputs to the fields, and functions that apply them in a substep."""
