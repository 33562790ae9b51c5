"""The public face: a world and its bodies."""
