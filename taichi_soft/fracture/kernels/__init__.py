"""Kernels that rewrite a body whose mesh has changed, and that find overloaded bodies."""
