"""Simulation of a step: schedules, substeps, integrators, sleep, and recovery from failures."""
