"""Motion against theory, beyond the thesis: frequencies, waves, contact, and what is conserved."""

from taichi_soft.experiments.dynamics.natural_frequencies import FREQUENCIES
from taichi_soft.experiments.dynamics.wave_speed import WAVE_SPEED

__all__ = ["FREQUENCIES", "WAVE_SPEED"]
