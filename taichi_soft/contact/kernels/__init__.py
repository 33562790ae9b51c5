"""Broad phase, narrow phase and contact solvers."""
