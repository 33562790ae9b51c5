"""Numbers with a unit and a reason."""

from __future__ import annotations

GRAVITY_EARTH = 9.81
"""Standard fall on Earth [m/s^2], as the thesis uses it."""

LANES = 8
"""Tetrahedra per block. Eight float32 fill one AVX register: the compiler then computes a block in
vector instructions. Four were 1.3 times slower, sixteen compiled ten times longer for no gain."""

HALF = LANES // 2
"""Edges of one particle in half a block of edges. Where each has some nine edges, few particles can own eight
and most can own four: so blocks are full that would be two thirds full otherwise."""

ROW_BITS = (1 << 28) - 1
"""Mask that leaves every row of a field unchanged, and shows the compiler that adding a lane to it does not
overflow: without it nothing becomes vector instructions."""

POSITION_LIMIT = 1.0e7
"""Farthest coordinate [m] that still counts as finite. Beyond it float32 cannot resolve a body at all
(its spacing is 1 m), so a particle out there has been thrown by an explosion."""

VELOCITY_LIMIT = 2.0e4
"""Highest velocity [m/s] that still counts as sound: twice what leaves the Earth. A lower bound stops an
explosion while the body is still somewhere near its shape."""

ALL_GROUPS = 0x7FFFFFFF
"""A mask that meets every group of colliders and bodies."""
