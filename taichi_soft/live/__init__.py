"""A world live in the browser."""
