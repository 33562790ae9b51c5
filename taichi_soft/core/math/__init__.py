"""Linear algebra on values: pure Taichi functions for float32 and float64."""
