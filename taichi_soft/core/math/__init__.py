"""Small algebra on values: pure Taichi functions, usable in float32 and float64 alike."""
