"""Workarounds for Taichi 1.7.4.

One file per shortcoming. The last paragraph of a file's module docstring names the change in Taichi that
makes the file needless. "Taichi's main branch" is commit ba0e81d of 30 July 2025, the newest when these files
were checked. Only `taichi_soft.core.runtime` imports from here. It applies everything, and exports `ti`.
"""
