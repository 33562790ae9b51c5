"""Status and control of bodies as numbers in their fields."""

ACTIVE, FROZEN, ASLEEP, SKIPPING, ABSENT = 0, 1, 2, 3, 4
"""Status of a body: it moves; it became non-finite and rests; it sleeps; it skips the coming step; its slot
is empty."""

MOVES_PINS, FEELS_REACTION, PUSHED, DAMPED, SHELTERED, GRABBED, JOINED = 1, 2, 4, 8, 16, 32, 64
"""Bits of `body_drives`: some pinned particles have targets; their reactions are summed; `particle_push` acts
in the coming step; `body_damping` is not zero; the wind ignores the body; a grab pulls at it; a joint
connects it to another."""

PLACED = -1000
"""`body_patience` of a body that was placed, possibly with inverted tetrahedra."""

CLEAR, JUST_PLACED, OVERLAPPING = range(3)
"""Overlap of a body with others, in a world with soft contact: none; unknown until the next step, since the
body was placed; found, and being resolved."""

STILL, TO_TARGET, ARRIVED, WITH_FRAME = 0, 1, 2, 3
"""`particle_aim`: motion of a pinned particle in the next step: none; to its target; none after it has
reached its target, with its velocity still to clear; with a frame, whose number is added."""
