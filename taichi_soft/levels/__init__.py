"""Change of a body's level of detail while it moves."""
