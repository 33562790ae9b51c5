"""Workarounds for Taichi 1.7.4.

One file for each shortcoming. The last paragraph of a file's first docstring names the change in Taichi that
makes the file needless. "Taichi's main branch" is commit ba0e81d of 30 July 2025, the newest when these files
were checked. `taichi_soft.core.runtime` alone imports from here, applies everything, and passes `ti` on.
"""
