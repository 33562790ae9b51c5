"""Numbers in the fields of bodies that encode their status and control."""

ACTIVE, FROZEN, ASLEEP, SKIPPING, ABSENT, DISABLED, FROZEN_DISABLED = 0, 1, 2, 3, 4, 5, 6
"""Values of `body_status`. ACTIVE: the body moves. FROZEN: it became non-finite and is frozen. ASLEEP: it
sleeps. SKIPPING: it skips the next step. ABSENT: the slot is empty. DISABLED: it was switched off.
FROZEN_DISABLED: it was frozen and then switched off. A body from ABSENT on takes part in nothing."""

MOVES_PINS, FEELS_REACTION, PUSHED, DAMPED, SHELTERED, GRABBED, JOINED = 1, 2, 4, 8, 16, 32, 64
"""Bits of `body_drives`. MOVES_PINS: a pinned particle has a target. FEELS_REACTION: reactions of pinned
particles are summed. PUSHED: `particle_push` acts in the next step. DAMPED: `body_damping` is not zero.
SHELTERED: wind does not act on the body. GRABBED: a grab pulls the body. JOINED: a joint connects the body
to another body."""

PLACED = -1000
"""Value of `body_patience` directly after the caller set the shape of a body. The shape can have inverted
tetrahedra."""

CLEAR, JUST_PLACED, OVERLAPPING = range(3)
"""Values of `body_overlap` in a world with soft contact. CLEAR: the body overlaps no other body.
JUST_PLACED: the body was just placed, and the next step must check it. OVERLAPPING: contact is resolving
an overlap."""

STILL, TO_TARGET, ARRIVED, WITH_FRAME = 0, 1, 2, 3
"""Values of `particle_aim`, the motion of a pinned particle in the next step. STILL: the particle does not
move. TO_TARGET: it moves to its target. ARRIVED: it has reached its target, and its velocity must be
cleared. WITH_FRAME: it moves with a frame, whose number is added to the value."""
