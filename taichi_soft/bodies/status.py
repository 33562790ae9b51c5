"""What a body is doing, and what is done to it, as numbers in its fields."""

ACTIVE, FROZEN, ASLEEP, SKIPPING, ABSENT = 0, 1, 2, 3, 4
"""Status of a body: it moves, it went non-finite and rests, it sleeps, it skips the coming step, its slot is
empty."""

MOVES_PINS, FEELS_REACTION, PUSHED, DAMPED, SHELTERED, GRABBED, JOINED = 1, 2, 4, 8, 16, 32, 64
"""Bits of `body_drives`: some pinned particles have somewhere to go; what they take up is added up;
`particle_push` counts in the coming step; `body_damping` is not zero; the wind misses the body; a
grab pulls at it; a joint holds it to another."""

PLACED = -1000
"""`body_patience` of a body that was put where it is, perhaps wrecked."""

CLEAR, JUST_PLACED, OVERLAPPING = range(3)
"""Overlap of a body with others, in a world where bodies touch each other: none; to be looked for in the next
step, since the body was placed; some, of which the body is being moved out."""
