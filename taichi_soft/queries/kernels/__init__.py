"""Kernels of queries."""
