"""Bodies of particles and springs in a world with solid bodies, and pins."""

import numpy as np
import pytest

from taichi_soft import (
    FrozenBodyWarning,
    Material,
    MeshError,
    OptionError,
    ParticleMesh,
    SpringMaterial,
    box,
    cloth,
    cloth_constants,
    rope,
    sphere,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak


@pytest.mark.parametrize("schedule", ["per_body", "flat"])
def test_a_weight_on_a_spring_swings_as_the_pendulum_formula_says(schedule):
    """x'' = g - k/m x from rest: x = (m g / k)(1 - cos(w t))."""
    mesh = ParticleMesh([[0, 0, 0], [0, 0, -1.0]], [[0, 1]], [1.0, 2.0])
    world = bare_world(floor=None, schedule=schedule)
    body = world.add_body(mesh, SpringMaterial(500.0), law="springs", pinned=[0])
    world.build()
    w = np.sqrt(500.0 / 2.0)
    for step in range(1, 41):
        world.step(0.01, 20)
        sag = -1.0 - body.positions()[1, 2]
        assert sag == pytest.approx(2.0 * 9.81 / 500.0 * (1 - np.cos(w * 0.01 * step)), abs=2e-4)
    assert body.positions()[0].tolist() == [0, 0, 0]


def test_an_undamped_lattice_keeps_its_energy_in_flight():
    mesh = rope(1.0, 6, 1.0)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(mesh, SpringMaterial(100.0), law="springs")
    world.build()
    body.set_motion(mesh.vertices, np.random.default_rng(0).normal(size=mesh.vertices.shape))
    start = body.kinetic_energy() + body.elastic_energy()
    for _ in range(50):
        world.step(0.02, 40)
        assert body.kinetic_energy() + body.elastic_energy() == pytest.approx(start, rel=0.01)


@pytest.mark.parametrize(
    ("integrator", "dt", "steps"), [("leapfrog", 1 / 60, 1200), ("implicit_euler", 1 / 30, 600)]
)
def test_a_cloth_without_bending_springs_hangs_by_its_threads_and_meshes_alone(integrator, dt, steps):
    """At rest, the remaining springs, computed here, carry the weight of every free particle."""
    cells, k = (6, 6), {"tensile": 200.0, "shear": 100.0, "bend": 0.0}
    mesh = cloth((1.0, 1.0), cells, 0.3)
    stiffness = cloth_constants(mesh, cells, **k)
    world = bare_world(floor=None, integrator=integrator)
    down = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    body = world.add_body(
        mesh, SpringMaterial(stiffness, 0.5), pinned=[0, 6], position=(0, 0, 1.5), rotation=down
    )
    world.build()
    threads = cloth((1.0, 1.0), cells, 0.3, springs=("tensile", "shear"))
    of_threads = cloth_constants(threads, cells, tensile=k["tensile"], shear=k["shear"])
    alike = bare_world(floor=None, integrator=integrator)
    alike.add_body(threads, SpringMaterial(of_threads), position=(0, 0, 2))
    assert body.stable_step.undamped == pytest.approx(alike.bodies[0].stable_step.undamped, rel=0.02)
    for _ in range(steps):
        world.step(dt)
    x = body.positions().astype(np.float64)
    p, q = threads.edges.T
    r = x[q] - x[p]
    length = np.linalg.norm(r, axis=1)
    pull = (of_threads * (length - threads.edge_lengths) / length)[:, None] * r
    force = threads.masses[:, None] * np.array([0, 0, -9.81])
    np.add.at(force, p, pull)
    np.add.at(force, q, -pull)
    force[[0, 6]] = 0
    assert np.abs(force).max() < 0.02 * 0.3 * 9.81 / 49
    assert x[:, 2].min() < 1.1


KINDS = ("virial", "neo_hookean", "volume_springs", "cmpm", "best_fitting_plane")
"""Laws that look at tetrahedra, at edges and their tetrahedra, and at rings of two kinds."""


@pytest.mark.parametrize("schedule", ["per_body", "flat"])
def test_ropes_and_solids_of_every_kind_of_law_share_a_world(schedule):
    """Each body moves as it does in a world of its own."""
    ball, material = sphere(0.4, 1), Material(2e5, 0.2, 1000.0, 10.0)
    every = [((ball, material), {"law": law, "position": (2.0 * i, 0, 0.7)}) for i, law in enumerate(KINDS)]
    chain = rope(1.0, 5, 0.2), SpringMaterial(50.0, 0.1)
    every.append((chain, {"law": "springs", "pinned": [0], "position": (0.5, 3, 2)}))

    def moved(*bodies):
        world = bare_world(schedule=schedule)
        for made_of, options in bodies:
            world.add_body(*made_of, **options)
        world.build()
        for _ in range(30):
            world.step(1 / 60, 8)
        return [body.positions() for body in world.bodies]

    for rows, body in zip(moved(*every), every, strict=True):
        np.testing.assert_allclose(rows, moved(body)[0], atol=1e-5)


@pytest.mark.guard
@pytest.mark.parametrize("schedule", ["per_body", "flat"])
@pytest.mark.parametrize("law", ["virial", "springs", "cmpm2"])
def test_pinned_vertices_stay_and_hold_the_body(schedule, law):
    mesh = box((0.5, 0.5, 1.0), (1, 1, 2))
    top = np.flatnonzero(mesh.vertices[:, 2] > mesh.bounds[1, 2] - 1e-6)
    world = bare_world(schedule=schedule)
    body = world.add_body(mesh, Material(2e5, 0.2, 1000.0, 30.0), law=law, pinned=top, position=(0, 0, 2))
    world.build()
    before = body.positions()[top].tobytes()
    for _ in range(100):
        world.step(1 / 60)
    assert body.positions()[top].tobytes() == before
    assert np.abs(body.velocities()[top]).max() == 0
    assert body.center_of_mass()[2] == pytest.approx(2 + mesh.vertices[:, 2].mean(), abs=0.1)
    assert body.pinned.tolist() == top.tolist()


@pytest.mark.parametrize(
    ("pinned", "text"),
    [
        ([99], "pinned.*vertex 99.*0 to 7"),
        ([-1], "pinned names vertex -1"),
        ([0.5], "pinned.*list"),
        ("all", "pinned must be a list"),
        ([[0, 1]], "pinned must be a list"),
    ],
)
def test_pins_that_are_no_vertices_are_refused(pinned, text):
    world = bare_world()
    with pytest.raises(OptionError, match=text):
        world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.3, 1e3), position=(0, 0, 1), pinned=pinned)
    assert world.bodies == ()


def test_a_spring_that_breaks_the_body_is_named_and_the_rest_goes_on():
    chain = rope(1.0, 4, 0.2)
    world = bare_world(floor=None, retries=0)
    bad = world.add_body(chain, SpringMaterial([10.0, 10.0, 1e9, 10.0]), law="springs")
    good = world.add_body(chain, SpringMaterial(10.0), law="springs", position=(0, 2, 0))
    world.build()
    bad.set_motion(chain.vertices * 1.5, np.zeros_like(chain.vertices))
    with pytest.warns(FrozenBodyWarning, match="body 0 went non-finite"):
        world.step(1.0, 20)
    assert bad.is_frozen
    assert bad.failure.tetrahedron is None
    assert bad.failure.edge in [(1, 2), (2, 3), (3, 4)]
    assert not good.is_frozen
    assert np.isfinite(good.positions()).all()


def test_what_needs_tetrahedra_says_so():
    world = bare_world(floor=None)
    body = world.add_body(rope(1.0, 4, 0.2), SpringMaterial(10.0), law="springs")
    world.build()
    assert repr(body) == "Body(0, 5 vertices, 4 edges, active)"
    assert body.flipped_count() == 0
    assert body.volume() == 0
    for ask in (body.deformations, body.strains, body.vertex_stress):
        with pytest.raises(MeshError, match="body 0 has no tetrahedra"):
            ask()


def test_a_particle_mesh_takes_springs_only():
    world = bare_world()
    with pytest.raises(MeshError, match=r"'virial'.*law='springs'.*SpringMaterial"):
        world.add_body(rope(1.0, 4, 0.2), SpringMaterial(10.0), law="virial", position=(0, 0, 1))
    assert world.bodies == ()
    assert world.add_body(rope(1.0, 4, 0.2), SpringMaterial(10.0), position=(0, 0, 1)).asset.law == "springs"
