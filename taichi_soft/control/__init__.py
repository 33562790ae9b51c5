"""What a game does to a body between two steps: arguments checked, then one kernel call each."""
