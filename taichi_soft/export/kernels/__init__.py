"""Kernels that replace Python code in the native library."""
