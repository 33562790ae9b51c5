"""Cutting and tearing of bodies."""
