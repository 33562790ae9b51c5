"""Bodies: assets, layout, fields, and quantities derived from material and state."""
