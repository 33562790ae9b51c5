"""Games that scripts in Godot can play."""

import numpy as np
import scenes
from games import line

UPRIGHT, HALF_TURN = (0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.0)  # both are exact in Godot's transforms
LEAST = 2**-10
"""All numbers are multiples of it. 32 bits hold them exactly, and Godot 3 reads them without an error."""

TURN_BEGINS = {"spawn": 4, "add_frame": 3, "move_frame": 4}
"""Index of the quaternion in the numbers of a call."""

MISSING = {"pin", "unpin", "targets", "force", "closest", "stable_substeps"}
"""Calls that the class for scripts does not have."""


def levels_game():
    """The kept game `levels`, as far as scripts can play it: its calls with rounded numbers."""
    for text in scenes.levels_game():
        call, *words = text.split()
        numbers = np.array([float(word) for word in words])
        is_partial = call == "impulse" and numbers[4] > 0  # it names vertices
        is_between = call == "positions" and numbers[1] < 1.0  # it is between two steps
        if call in MISSING or is_partial or is_between:
            continue
        numbers = np.round(numbers / LEAST) * LEAST
        if call in TURN_BEGINS:
            first = TURN_BEGINS[call]
            numbers[first : first + 4] = HALF_TURN if call == "spawn" else UPRIGHT
        yield line(call, numbers)
