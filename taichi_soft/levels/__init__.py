"""Change the level of detail of a body while it moves."""
