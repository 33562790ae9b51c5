"""A stiffer material takes effect gradually, so that it adds no energy to a deformed body."""

import numpy as np
import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    ParticleMesh,
    SoftBodyAsset,
    SpringMaterial,
    Stiffness,
    box,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT, G = 1 / 60, 9.81
SIDE, DENSITY = 0.4, 1000.0
CUBE = box((SIDE, SIDE, SIDE), (3, 3, 3))
LATTICE = ParticleMesh(CUBE.vertices, CUBE.edges, SIDE**3 * DENSITY / len(CUBE.vertices))


def jelly(young, poisson=0.3):
    return Material(young, poisson, DENSITY, 5.0)


def grain(young):
    return AnisotropicMaterial(Stiffness.isotropic(young, 0.3), DENSITY, 5.0)


def springs(young):
    """About as stiff: a spring for a column of the cross section that is as wide as it is long."""
    return SpringMaterial(young * SIDE / 6, 5.0)


KINDS = {
    "virial": (CUBE, jelly, {"law": "virial"}),
    "neo_hookean": (CUBE, jelly, {"law": "neo_hookean"}),
    "st_venant_kirchhoff": (CUBE, jelly, {"law": "st_venant_kirchhoff"}),
    "anisotropic": (CUBE, grain, {}),
    "springs": (LATTICE, springs, {}),
}
SOFT, STIFF = 2e4, 4e6

CHOSEN = {"leapfrog": list(KINDS), "implicit_euler": ["neo_hookean", "springs"]}
"""Of each integrator: an implicit step of many laws compiles for minutes."""


def energy(body):
    return body.kinetic_energy() + body.elastic_energy() + body.gravitational_energy()


def row_of(integrator):
    """A cube of each kind, two metres apart."""
    world = bare_world(integrator=integrator)
    for i, name in enumerate(CHOSEN[integrator]):
        mesh, material, law = KINDS[name]
        world.add_body(mesh, material(SOFT), position=(2.0 * i, 0, SIDE / 2 + 1e-4), **law)
    world.build()
    return world


@pytest.fixture(scope="module", params=["leapfrog", "implicit_euler"])
def scene(request):
    """Cubes that their weight has flattened in three seconds."""
    world = row_of(request.param)
    for _ in range(180):
        world.step(DT)
    for body in world.bodies:
        assert np.ptp(body.positions()[:, 2]) < 0.98 * SIDE
    return world, world.snapshot()


def neo_hookean(world):
    """The cube whose energy is exact."""
    return world.bodies[CHOSEN[world.settings.integrator.value].index("neo_hookean")]


def begin(scene):
    world, data = scene
    world.restore(data)
    return world


def stiffen(world, young=STIFF):
    for body, name in zip(world.bodies, CHOSEN[world.settings.integrator.value], strict=True):
        body.set_material(KINDS[name][1](young))


def test_a_cube_that_its_weight_has_flattened_rises_and_does_not_jump(scene):
    """200 times as stiff at once it would jump metres high. It rises to its rest shape, less the new sag."""
    world = begin(scene)
    stored = [body.elastic_energy() for body in world.bodies]
    stiffen(world)
    for _ in range(120):
        world.step(DT)
        for body, before in zip(world.bodies, stored, strict=True):
            assert body.positions()[:, 2].min() < 1e-3
            assert body.kinetic_energy() < before
    for body in world.bodies:
        height = np.ptp(body.positions()[:, 2])
        sag = DENSITY * G * SIDE**2 / (2 * STIFF)
        assert SIDE - 4 * sag < height < SIDE + 1e-5
        assert body.kinetic_energy() < 1e-3 * body.masses.sum()
        assert body.flipped_count() == 0 if len(body.tets) else True


@pytest.mark.guard
def test_a_slider_that_is_drawn_to_and_fro_adds_nothing(scene):
    """Each call begins at the constants that the one before has come to."""
    world = begin(scene)
    for k in range(90):
        stiffen(world, SOFT * (STIFF / SOFT) ** (0.5 - 0.5 * np.cos(0.14 * k)))
        world.step(DT)
        for body in world.bodies:
            assert body.positions()[:, 2].min() < 2e-3
    stiffen(world)
    for _ in range(90):
        world.step(DT)
        assert max(body.positions()[:, 2].min() for body in world.bodies) < 2e-3


def test_a_free_body_gains_no_energy_and_keeps_its_momentum(scene):
    """Stretched and thrown, it ends unstretched, with the motion of its centre."""
    world = begin(scene)
    velocity = np.array([0.5, 0.2, 0.0])
    for body in world.bodies:
        rest = body.mesh.vertices
        body.set_gravity_scale(0.0)
        body.set_motion(rest * (1.2, 0.9, 0.9) + body.center_of_mass() + (0, 0, 1), 0 * rest + velocity)
    before = [(energy(body), body.elastic_energy(), body.momentum()) for body in world.bodies]
    stiffen(world)
    for _ in range(75):
        world.step(DT)
        for body, (total, stored, _) in zip(world.bodies, before, strict=True):
            assert energy(body) < total + 0.2 * stored
    for body, (total, stored, momentum) in zip(world.bodies, before, strict=True):
        assert energy(body) == pytest.approx(total - stored, abs=0.02 * stored)
        np.testing.assert_allclose(body.momentum(), momentum, atol=1e-3 * np.linalg.norm(momentum))


def test_a_body_that_nothing_deforms_is_stiffer_at_once_and_any_body_softer(scene):
    world = begin(scene)
    body = neo_hookean(world)
    rest = body.mesh.vertices
    for start, end in ((SOFT, STIFF), (STIFF, SOFT)):
        body.set_motion(rest + np.array([0, 0, 3]), 0 * rest)
        body.set_material(jelly(start))
        if end < start:
            body.set_motion(rest * (1.01, 1, 1) + np.array([0, 0, 3]), 0 * rest)
        body.set_material(jelly(end))
        body.set_motion(rest * (1.01, 1, 1) + np.array([0, 0, 3]), 0 * rest)
        mu, lam = end / 2.6, end * 0.3 / (1.3 * 0.4)
        expected = SIDE**3 * (lam / 2 + mu) * 0.01**2  # small strain in one direction
        assert body.elastic_energy() == pytest.approx(expected, rel=0.02)


def test_what_is_read_on_the_way_is_of_the_constants_that_act(scene):
    """Measure the stiffness of springs from their energy.

    The compliance decreases as a parabola for half a second. A body that is teleported has the new stiffness
    immediately.
    """
    world = begin(scene)
    body, rest = world.bodies[-1], LATTICE.vertices

    def stiffness():
        ends = body.positions()[LATTICE.edges].astype(float)
        grown = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - LATTICE.edge_lengths
        return body.elastic_energy() / (0.5 * (grown**2).sum())

    old, new = (springs(young).stiffness for young in (SOFT, STIFF))
    body.set_material(springs(STIFF))
    for k in range(40):
        expected = old * (1 - (1 - np.sqrt(old / new)) * min(k * DT / 0.5, 1)) ** -2
        assert stiffness() == pytest.approx(expected, rel=1e-3)
        world.step(DT)
    world = begin(scene)
    body.set_material(springs(STIFF))
    world.step(DT)
    body.set_motion(1.1 * rest + np.array([0, 0, 3]), 0 * rest)
    assert stiffness() == pytest.approx(new, rel=1e-3)


def test_a_change_under_way_goes_on_after_restore_bit_for_bit(scene):
    world = begin(scene)
    stiffen(world)
    for _ in range(10):
        world.step(DT)
    data, first = world.snapshot(), []
    for _ in range(30):
        world.step(DT)
        first.append(world.state_hash())
    for disturb in (lambda: None, lambda: stiffen(world, 3 * STIFF), lambda: begin(scene)):
        disturb()
        world.step(DT)
        world.restore(data)
        again = []
        for _ in range(30):
            world.step(DT)
            again.append(world.state_hash())
        assert again == first
    straight = world.state_hash()
    begin(scene)  # from a world without changes
    world.restore(data)
    for _ in range(30):
        world.step(DT)
    assert world.state_hash() == straight


def test_pieces_and_those_who_come_after_are_of_what_they_should_be():
    """A change goes on in all pieces of a body that is cut, and ends with a body that is removed."""
    world = bare_world(floor=None, gravity=(0, 0, 0))
    asset = SoftBodyAsset(CUBE, jelly(SOFT), law="neo_hookean", spare_vertices=60)
    world.reserve(asset, 4)
    world.build()
    body = world.spawn(asset)
    body.set_motion(CUBE.vertices * (1.2, 0.9, 0.9), 0 * CUBE.vertices)
    stored = body.elastic_energy()
    body.set_material(jelly(STIFF))
    for _ in range(3):
        world.step(DT)
    before = sum(each.elastic_energy() for each in world.bodies)
    pieces = (body, *body.cut(plane=((0.05, 0, 0), (1, 0.1, 0))))
    assert len(pieces) == 2
    assert sum(each.elastic_energy() for each in pieces) == pytest.approx(before, rel=1e-3)
    for _ in range(60):
        world.step(DT)
        assert sum(energy(each) for each in pieces) < 1.3 * stored
    assert sum(energy(each) for each in pieces) < 0.1 * stored
    body = pieces[1]
    world.despawn(pieces[0])
    fresh = [world.spawn(asset) for _ in range(2)]
    fresh[0].set_motion(CUBE.vertices * (1.2, 0.9, 0.9), 0 * CUBE.vertices)
    fresh[0].set_material(jelly(STIFF))
    world.step(DT)
    world.despawn(fresh[0])
    late = world.spawn(asset)
    for each in (fresh[1], late):
        each.set_motion(CUBE.vertices * (1.1, 1, 1), 0 * CUBE.vertices)
    for _ in range(20):
        world.step(DT)
    assert late.positions().tobytes() == fresh[1].positions().tobytes()
