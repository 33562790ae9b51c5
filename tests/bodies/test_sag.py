"""Bodies that cannot bear their own weight: `World.build` warns, and suggests a sufficient modulus."""

import re
import warnings

import numpy as np
import pytest

from taichi_soft import Material, TooSoftWarning, box
from taichi_soft.world.bare import bare_world

BLOCK = box((1, 1, 1), (2, 2, 2))
SLAB = box((1, 1, 0.1), (2, 2, 1))


def said_of(mesh, material, **options):
    """Return the warnings of `build` for a world with such a body."""
    world = bare_world(**options)
    world.add_body(mesh, material, position=(0, 0, 5))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        world.build()
    return [each for each in caught if each.category is TooSoftWarning]


def test_a_block_that_weighs_more_at_its_foot_than_a_fifth_of_its_modulus_is_named_with_one_that_bears():
    """A column of 1 m and 1,000 kg/m^3 presses with 9,807 Pa."""
    (found,) = said_of(BLOCK, Material(20e3, 0.3, 1000.0))
    assert found.filename == __file__
    said = str(found.message)
    assert "9.81e+03 Pa" in said
    enough = float(re.search(r"modulus of ([\d.e+]+) Pa", said)[1])
    assert enough == pytest.approx(5 * 9807, rel=0.05)
    assert not said_of(BLOCK, Material(enough, 0.3, 1000.0))


def test_the_modulus_that_bears_is_above_the_one_that_does_not_where_both_are_close():
    """5 * 9,807 Pa is 49,033 Pa: to two digits, it is the modulus of 49 kPa that does not bear."""
    (found,) = said_of(BLOCK, Material(49e3, 0.3, 1000.0))
    assert "a modulus of 5e+04 Pa" in str(found.message)


@pytest.mark.parametrize(
    ("mesh", "material", "options"),
    [
        (SLAB, Material(20e3, 0.3, 1000.0), {}),
        (BLOCK, Material(20e3, 0.3, 100.0), {}),
        (BLOCK, Material(20e3, 0.3, 1000.0), {"gravity": (0, 0, -1.6)}),
        (BLOCK, Material(20e3, 0.3, 1000.0), {"gravity": (0, 0, 0)}),
        (BLOCK.scaled(0.1), Material(20e3, 0.3, 1000.0), {}),
    ],
)
def test_thin_light_and_small_bodies_and_those_with_little_gravity_are_not(mesh, material, options):
    assert not said_of(mesh, material, **options)


def test_of_several_materials_in_a_body_the_softness_counts_by_volume():
    """One half is ten times as stiff.

    The column is compressed by 0.55 of the compression of a soft column.
    """
    z = BLOCK.vertices[BLOCK.tets].mean(axis=1)[:, 2]
    layered = Material(np.where(z > 0, 400e3, 40e3), 0.3, 1000.0)
    assert said_of(BLOCK, Material(40e3, 0.3, 1000.0))
    assert not said_of(BLOCK, layered)
