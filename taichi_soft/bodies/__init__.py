"""Bodies: assets, layout, fields, and quantities that follow from their material."""
