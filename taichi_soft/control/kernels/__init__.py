"""What a game writes into the fields, and what the substep does with it."""
