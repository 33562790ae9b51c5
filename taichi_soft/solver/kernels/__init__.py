"""The phases of a step, and the loops that make it."""
