"""State as words: all that passes from one step to the next, copied and hashed."""
