"""A body comes back from anything: by default, and by the thesis's law with flips driven back."""

import warnings

import numpy as np
import pytest
import trimesh

from lab.drop_test.robustness.foreign_meshes import sliver_lattice
from taichi_soft import Material, SoftBodyAsset, SolverWarning, box, sphere
from taichi_soft.world.bare import bare_world

BALL = sphere(1.0, 2)
RNG = np.random.default_rng(4)
WRECKS = {
    "scrambled": RNG.uniform(-1, 1, BALL.vertices.shape),
    "flattened": BALL.vertices * (1, 1, 0),
    "turned inside out": -BALL.vertices,
    "shrunk to a point": BALL.vertices * 1e-3,
    "drawn into a line": BALL.vertices * (1, 0, 0),
}


@pytest.mark.parametrize("wreck", WRECKS)
@pytest.mark.parametrize("poisson", [0.2, 0.45])
@pytest.mark.parametrize("strain", ["linear", pytest.param("exact", marks=pytest.mark.soak)])
def test_a_wrecked_body_finds_its_shape_again(strain, poisson, wreck):
    world = bare_world(gravity=(0, 0, 0), floor=None)
    body = world.add_body(BALL, Material(1e5, poisson, 1000, 200), strain=strain, flips="recover")
    world.build()
    start = WRECKS[wreck] + RNG.normal(scale=1e-3, size=BALL.vertices.shape)
    body.set_motion(start, np.zeros_like(start))
    for _ in range(600):
        world.step(1 / 60, 8)
    assert not body.is_frozen
    assert body.flipped_count() == 0
    corners = body.positions().astype(float)[BALL.edges]
    lengths = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    np.testing.assert_allclose(lengths, BALL.edge_lengths, rtol=0.01)


def crumpled(mesh, wreck, rng):
    """Return deformed positions of a body's vertices."""
    x = mesh.vertices - mesh.vertices.mean(axis=0)
    noise = 1e-4 * rng.normal(size=x.shape)
    return {
        "scrambled": rng.permutation(x),
        "flattened": x * (1, 1, 0) + noise,
        "drawn into a line": x * (1, 0, 0) + noise,
        "turned inside out": x * (-1, 1, 1),
        "shrunk": x * 1e-3 + noise,
        "shrunk to a point": np.zeros_like(x),
    }[wreck]


def distance_from_rest(mesh, x, mass):
    """Root mean square way of the vertices beside the best rigid motion (Kabsch), over the size."""
    share = (mass / mass.sum())[:, None]
    rest, now = (rows - (share * rows).sum(axis=0) for rows in (mesh.vertices, x))
    left, _, right = np.linalg.svd((share * rest).T @ now)
    turn = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    return np.sqrt((share * (rest @ turn - now) ** 2).sum()) / np.ptp(mesh.vertices, axis=0).max()


def test_by_default_any_wreck_finds_its_shape_on_the_floor_within_ten_seconds():
    """Law, flips, damping and substeps have their default values, in a plain world."""
    rng = np.random.default_rng(0)
    meshes = [box((1, 1, 1), (2, 2, 2)), box((1, 1, 1), (4, 4, 4)), sphere(0.5, 2), sphere(0.5, 4)]
    wrecks = [
        "scrambled",
        "flattened",
        "drawn into a line",
        "turned inside out",
        "shrunk",
        "shrunk to a point",
    ]
    world = bare_world()
    bodies = [
        (world.add_body(mesh, Material(1e6, 0.3, 1000.0), position=(3 * i, 3 * j, 1.0)), wreck)
        for i, mesh in enumerate(meshes)
        for j, wreck in enumerate(wrecks)
    ]
    world.build()
    for body, wreck in bodies:
        start = crumpled(body.mesh, wreck, rng)
        place = np.array([*body.center_of_mass()[:2], 0.1 - start[:, 2].min()])
        body.set_motion(start + place, np.zeros_like(start))
    for _ in range(600):
        world.step(1 / 60)
    assert [(body.is_frozen, body.flipped_count()) for body, _ in bodies] == [(False, 0)] * len(bodies)
    for body, _ in bodies:
        body.set_gravity_scale(0.0)
        body.set_linear_damping(2.0)
    for _ in range(240):
        world.step(1 / 60)
    for body, wreck in bodies:
        distance = distance_from_rest(body.mesh, body.positions().astype(float), body.masses)
        assert distance < 0.01, (wreck, distance)


@pytest.mark.parametrize("seed", [2, 4, 11])
def test_slivers_that_a_blow_turned_inside_out_do_not_tremble_on(seed):
    """Three metres of jelly, of tetrahedra a thousandth as thick as wide; they did so for 4 s and longer."""
    mesh = sliver_lattice(3.0, 5, 0.001, seed)
    world = bare_world()
    body = world.add_body(mesh, Material(1e6, 0.3, 1000), position=(0, 0, 2 - mesh.vertices[:, 2].min()))
    world.build()
    for _ in range(150):
        world.step(1 / 60)
    caught = []
    for _ in range(90):
        world.step(1 / 60)
        caught.append(body.flipped_count())
    assert not body.is_frozen
    assert np.mean(caught) <= 0.0005 * len(mesh.tets)


def table():
    """One metre wide, with legs that E = 50 kPa lets fold under it."""
    at = trimesh.transformations.translation_matrix
    parts = [trimesh.creation.box((1.0, 0.6, 0.4))]
    for x in (-0.4, 0.4):
        for y in (-0.2, 0.2):
            parts.append(trimesh.creation.box((0.16, 0.16, 0.7), transform=at((x, y, -0.45))))
    return trimesh.util.concatenate(parts)


def total_energy(body):
    """Return the sum of kinetic, elastic and potential energy [J]."""
    return body.kinetic_energy() + body.elastic_energy() + body.gravitational_energy()


def test_no_rescue_goes_below_the_floor_or_adds_energy_and_one_that_fails_is_reported_once():
    """Tables that fold under their own weight, and wrecks that lie on the floor, in a plain world."""
    rng, mesh = np.random.default_rng(0), sphere(0.5, 2)
    world = bare_world()
    tables = [
        world.add_body(
            SoftBodyAsset.from_surface(table(), Material(young, 0.4, 1000), cells=8), position=(x, 0, 1.3)
        )
        for x, young in ((0.0, 5e4), (3.0, 1e5))
    ]
    wrecks = ["scrambled", "flattened", "drawn into a line", "shrunk to a point"]
    balls = [
        world.add_body(mesh, Material(1e6, 0.3, 1000), position=(2 * k, 3, 1)) for k in range(len(wrecks))
    ]
    world.build()
    for ball, wreck in zip(balls, wrecks, strict=True):
        start = crumpled(mesh, wreck, rng)
        start += (*ball.center_of_mass()[:2], 0.02 - start[:, 2].min())
        ball.set_motion(start, np.zeros_like(start))
    lowest, energies = [], []
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", SolverWarning)
        for _ in range(300):
            world.step(1 / 60)
            lowest.append(min(body.positions()[:, 2].min() for body in world.bodies))
            energies.append([total_energy(body) for body in tables])
    assert min(lowest) > -1e-6
    energies = np.array(energies)
    assert (np.diff(energies, axis=0) < 1e-3 * energies[0]).all()
    caught = [body.index for body in tables if body.flipped_count()]
    assert caught == [0]
    reported = [str(each.message) for each in said if each.category is SolverWarning]
    assert [message.split(" has ")[0] for message in reported] == ["body 0"]


def test_what_folds_under_its_weight_comes_to_rest():
    """Faces stretched by a third make tetrahedra too stiff for the step of the rest shape.

    Some tetrahedra stay inverted. Vertices must not keep moving because of them.
    """
    world = bare_world(sleep_speed=0.02)
    for cells in (8, 10):
        asset = SoftBodyAsset.from_surface(table(), Material(5e4, 0.4, 1000), cells=cells)
        world.add_body(asset, position=(cells, 0, 1.3))
    world.build()
    for _ in range(600):
        world.step(1 / 60)
    assert [body.is_asleep for body in world.bodies] == [True, True]
