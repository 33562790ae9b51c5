"""The step: schedules, the substep, sleep, and what is done where it fails."""
