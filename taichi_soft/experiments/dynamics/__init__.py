"""Motion against theory, beyond the thesis: frequencies, waves, contact, and what is conserved."""

from taichi_soft.experiments.dynamics.natural_frequencies import FREQUENCIES

__all__ = ["FREQUENCIES"]
