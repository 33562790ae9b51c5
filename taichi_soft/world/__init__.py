"""Public interface of a world and its bodies."""
