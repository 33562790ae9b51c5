"""Linear algebra and geometry: Taichi functions for float32 and float64, and functions in NumPy."""
