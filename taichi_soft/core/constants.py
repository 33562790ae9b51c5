"""Constants, with their units and the reasons for their values."""

from __future__ import annotations

GRAVITY_EARTH = 9.81
"""Gravity on Earth [m/s^2], the value of the thesis."""

LANES = 8
"""Number of tetrahedra per block. Eight float32 numbers fill one AVX register, so the compiler vectorises a
block. Blocks of four are slower. Blocks of sixteen take much longer to compile and are no faster."""

HALF = LANES // 2
"""Number of edges in half a block. All edges of a half have the same first particle. A particle has about
nine edges, and it is the first particle of only some of them. Few particles would therefore fill a block of
eight edges, but most particles fill a half of four edges."""

ROW_BITS = (1 << 28) - 1
"""Mask that leaves every row number of a field unchanged. The compiler vectorises a loop only if adding a
lane number to a row number cannot overflow. The mask proves this to the compiler."""

POSITION_LIMIT = 1.0e7
"""Largest valid coordinate [m]. At this distance, the spacing of float32 is 1 m, too coarse for a body. A
particle exceeds the limit only if the simulation explodes."""

NEAR = 64.0
"""Distance from the origin of the world, along an axis, up to which the origin of a body is zero [m]. There,
float32 rounds positions to 4 um."""

CELL = 16.0
"""Spacing of the possible origins of bodies [m]. It is a power of two, so that positions move from one origin
to another without rounding."""

VELOCITY_LIMIT = 2.0e4
"""Largest valid velocity [m/s]: about twice Earth's escape velocity. The limit stops an explosion while the
body still has roughly its shape."""

ALL_GROUPS = 0x7FFFFFFF
"""Mask that matches every group of colliders and bodies."""
