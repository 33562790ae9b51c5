"""Constants with their units and reasons."""

from __future__ import annotations

GRAVITY_EARTH = 9.81
"""Gravity on Earth [m/s^2], the thesis's value."""

LANES = 8
"""Tetrahedra per block. Eight float32 fill one AVX register, so that the compiler vectorises a block. Four
are slower, and sixteen compile much longer without gain."""

HALF = LANES // 2
"""Edges of one particle in half a block of edges. A particle has about nine edges, so few particles can own
eight and most can own four: half blocks fill the blocks completely."""

ROW_BITS = (1 << 28) - 1
"""Mask that keeps every row of a field, and proves to the compiler that adding a lane does not overflow,
which vectorisation requires."""

POSITION_LIMIT = 1.0e7
"""Largest valid coordinate [m]. Beyond it float32 cannot resolve a body (its spacing is 1 m), so a particle
there comes from an explosion."""

VELOCITY_LIMIT = 2.0e4
"""Largest valid velocity [m/s]: about twice Earth's escape velocity. The limit stops an explosion while the
body still resembles its shape."""

ALL_GROUPS = 0x7FFFFFFF
"""Mask that matches every group of colliders and bodies."""
