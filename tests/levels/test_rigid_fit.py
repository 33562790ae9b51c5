"""The rigid motion of held vertices, against closed forms."""

import numpy as np

from taichi_soft.levels.rigid_fit import fitting_motion

RNG = np.random.default_rng(4)


def turn_about(axis, angle):
    """Rodrigues."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_places_that_were_moved_rigidly_give_that_motion():
    rest, axis = RNG.normal(size=(9, 3)), RNG.normal(size=3)
    for angle in (0.0, 1e-3, 2.0, np.pi):
        wanted, place = turn_about(axis, angle), RNG.normal(size=3)
        turn, origin = fitting_motion(rest, rest @ wanted.T + place)
        np.testing.assert_allclose(turn, wanted, atol=1e-12)
        np.testing.assert_allclose(origin, place, atol=1e-12)


def test_places_on_a_line_are_turned_as_little_as_possible_and_one_alone_is_not_turned():
    rest = np.outer([0.0, 1.0, 3.0], [1.0, 2.0, -1.0]) + np.array([5.0, 0.0, 0.0])
    axis = np.cross([1.0, 2.0, -1.0], [0.3, 0.1, 1.0])  # across the line
    wanted = turn_about(axis, 0.8)
    turn, origin = fitting_motion(rest, rest @ wanted.T + [1, 2, 3])
    np.testing.assert_allclose(turn, wanted, atol=1e-4)
    turn, origin = fitting_motion(rest[:1], rest[:1] + np.array([1, 2, 3]))
    assert (turn == np.eye(3)).all()
    np.testing.assert_allclose(origin, [1, 2, 3])
