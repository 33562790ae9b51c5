"""The phases of a step, and the kernels that run them."""
