"""Kernels that pack and hash the state that passes from one step to the next."""
