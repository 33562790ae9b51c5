"""Constants, with their units and the reasons for their values."""

from __future__ import annotations

GRAVITY_EARTH = 9.81
"""Gravity on Earth [m/s^2], the value of the thesis."""

LANES = 8
"""Tetrahedra per block. Eight float32 fill one AVX register, so that the compiler vectorises a block. Blocks
of four are slower; blocks of sixteen compile much longer and are no faster."""

HALF = LANES // 2
"""Number of edges per particle in half a block of edges. A particle has about nine edges. Since each edge
belongs to one of its two particles, few particles can own eight edges, but most can own four, so that half
blocks leave no gaps."""

ROW_BITS = (1 << 28) - 1
"""Mask that preserves every row number of a field. It proves to the compiler that adding a lane does not
overflow, which vectorisation requires."""

POSITION_LIMIT = 1.0e7
"""Largest valid coordinate [m]. Beyond it, float32 cannot resolve a body (the spacing is 1 m), so a particle
gets there only by an explosion."""

VELOCITY_LIMIT = 2.0e4
"""Largest valid velocity [m/s]: about twice Earth's escape velocity. The limit stops an explosion while the
body still has roughly its shape."""

ALL_GROUPS = 0x7FFFFFFF
"""Mask that matches every group of colliders and bodies."""
