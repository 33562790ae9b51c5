"""Workarounds for Taichi 1.7.4.

Each file works around one fault. The last paragraph of its module docstring names the change in Taichi that
would make the file unnecessary. "Taichi's main branch" is commit ba0e81d of 30 July 2025, the newest when
these files were checked. Only `taichi_soft.core.runtime` imports from here. It applies all workarounds, and
exports `ti`.
"""
