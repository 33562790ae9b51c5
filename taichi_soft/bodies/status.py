"""Numbers in the fields of bodies that encode their status and control."""

ACTIVE, FROZEN, ASLEEP, SKIPPING, ABSENT = 0, 1, 2, 3, 4
"""Status of a body, in this order: moving; frozen since it became non-finite; asleep; skipping the next step;
absent, with an empty slot."""

MOVES_PINS, FEELS_REACTION, PUSHED, DAMPED, SHELTERED, GRABBED, JOINED = 1, 2, 4, 8, 16, 32, 64
"""Bits of `body_drives`, in this order: some pinned particles have targets; reactions of pinned particles are
summed; `particle_push` acts in the next step; `body_damping` is not zero; the wind ignores the body; a grab
pulls at the body; a joint connects it to another body."""

PLACED = -1000
"""Value of `body_patience` after a body was placed, possibly with inverted tetrahedra."""

CLEAR, JUST_PLACED, OVERLAPPING = range(3)
"""Overlap of a body with others in a world with soft contact, in this order: none; unknown until the next
step, because the body was just placed; found, and being resolved."""

STILL, TO_TARGET, ARRIVED, WITH_FRAME = 0, 1, 2, 3
"""Values of `particle_aim`, the motion of a pinned particle in the next step: none; to its target; none, but
its velocity must still be cleared after it reached its target; with a frame, plus the frame's number."""
