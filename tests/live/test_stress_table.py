"""Display of a world's stress in a notebook."""

import re

import numpy as np
import pytest

from taichi_soft import Material, ParticleMesh, SpringMaterial, StateError, box
from taichi_soft.live import stress_table
from taichi_soft.world.bare import bare_world

SOFT = Material(young=1e5, poisson=0.3, density=500.0)


def stretched(share):
    """Make a bar that is stretched along x by a fraction of its length, and a bar at rest."""
    world = bare_world(floor=None, gravity=(0.0, 0.0, 0.0))
    mesh = box((1.0, 0.2, 0.2), (5, 1, 1))
    for y in (0.0, 1.0):
        world.add_body(mesh, SOFT, law="virial", position=(0.0, y, 0.0))
    world.build()
    bar = world.bodies[0]
    rows = bar.positions() * np.array([1.0 + share, 1.0, 1.0])
    bar.set_motion(rows, np.zeros_like(rows))
    return world


def test_a_bar_held_at_its_sides_has_the_stress_of_hookes_law_and_one_at_rest_none():
    share = 0.01
    world = stretched(share)
    table = stress_table(world)
    # Strain e along x alone: sigma_x - sigma_y = 2 mu e, which is the von Mises stress. The law's strain is
    # 1/2 (F F^T - 1).
    strain = ((1.0 + share) ** 2 - 1.0) / 2.0
    expected = SOFT.young / (1.0 + SOFT.poisson) * strain
    assert [row.body for row in table.rows] == [0, 1]
    assert table.rows[0].largest == pytest.approx(expected, rel=1e-3)
    assert table.rows[0].mean == pytest.approx(expected, rel=1e-3)
    assert table.rows[1].largest < 1e-3 * expected
    assert table.volumes.sum() == pytest.approx(0.04 * (2.0 + share), rel=1e-4)
    assert table.volumes[-1] == pytest.approx(0.04 * (1.0 + share), rel=1e-4)


def test_a_notebook_gets_a_line_for_each_body_and_a_bar_for_each_range():
    html = stress_table(stretched(0.02))._repr_html_()
    assert html.count("<tr>") == 3
    assert html.count("<rect") == 24
    assert re.search(r'aria-label="Histogram of material volume over stress, from 0 to [\d.]+ Pa"', html)


def test_a_world_without_tetrahedra_or_not_built_has_no_stress():
    with pytest.raises(StateError, match="not built"):
        stress_table(bare_world())
    world = bare_world(floor=None)
    rope = ParticleMesh([[0, 0, 0], [1, 0, 0]], [[0, 1]], masses=[1.0, 1.0])
    world.add_body(rope, SpringMaterial(stiffness=100.0))
    world.build()
    with pytest.raises(StateError, match="tetrahedra"):
        stress_table(world)
