"""Kernel that changes the level of detail of a body."""
