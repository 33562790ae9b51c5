"""Motion compared with theory (not in the thesis): frequencies, waves, contact, and conserved quantities."""

from lab.experiments.dynamics.energy_budget import ENERGY_BUDGET
from lab.experiments.dynamics.hertz import HERTZ
from lab.experiments.dynamics.momentum_budget import MOMENTUM_BUDGET
from lab.experiments.dynamics.natural_frequencies import FREQUENCIES
from lab.experiments.dynamics.wave_speed import WAVE_SPEED

__all__ = ["ENERGY_BUDGET", "FREQUENCIES", "HERTZ", "MOMENTUM_BUDGET", "WAVE_SPEED"]
