"""Constants and particles of a body whose mesh has changed, and where it is pulled too hard."""
