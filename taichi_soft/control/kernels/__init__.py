"""Kernels that write control inputs to the fields, and functions of the substep that apply them."""
