"""Public interface: a world and its bodies."""
