"""Numbers in the fields of bodies that encode their status and control."""

ACTIVE, FROZEN, ASLEEP, SKIPPING, ABSENT = 0, 1, 2, 3, 4
"""Status of a body, in this order: it moves; it is frozen, because it became non-finite; it is asleep; it
skips the next step; it is absent, and its slot is empty."""

MOVES_PINS, FEELS_REACTION, PUSHED, DAMPED, SHELTERED, GRABBED, JOINED = 1, 2, 4, 8, 16, 32, 64
"""Bits of `body_drives`, in this order: some pinned particles have targets; reactions of pinned particles are
summed; `particle_push` acts in the next step; `body_damping` is not zero; wind does not act on the body; a
grab pulls the body; a joint connects the body to another body."""

PLACED = -1000
"""Value of `body_patience` after a body was placed. Its tetrahedra can then be inverted."""

CLEAR, JUST_PLACED, OVERLAPPING = range(3)
"""Overlap of a body with other bodies in a world with soft contact. In this order: no overlap; unknown until
the next step, because the body was just placed; an overlap that contact resolves."""

STILL, TO_TARGET, ARRIVED, WITH_FRAME = 0, 1, 2, 3
"""Values of `particle_aim`, the motion of a pinned particle in the next step. In this order: it does not
move; it moves to its target; it has reached its target, and its velocity must be cleared; it moves with a
frame, whose number is added to the value."""
