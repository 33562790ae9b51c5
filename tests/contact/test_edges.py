"""Edges against edges: ridges of solids, ropes and sheets that meet where no vertex is near."""

import numpy as np
import pytest

from lab.contact.geometry import overlap, rope_distance
from taichi_soft import (
    Contact,
    Material,
    ParticleMesh,
    SpringMaterial,
    TetMesh,
    box,
    cloth,
    rope,
    sphere,
    torus,
)
from taichi_soft.bodies.contact_edges import OF_ROPE, OF_SHEET, find_contact_edges
from taichi_soft.world.bare import bare_world

DT = 1 / 60
FIRM = Material(young=2e6, poisson=0.3, density=500.0)
RUBBER = Material(young=1e6, poisson=0.3, density=500.0)
CORD = SpringMaterial(stiffness=2000.0, damping=0.5)
THICKNESS = 0.02  # of ropes [m]


def bar(across=False):
    """A bar of 1.2 m that lies on an edge of its square section, 0.1414 m high, along x or along y.

    Its edges are 0.24 m long, and no vertex is near its middle.
    """
    mesh = box((1.2, 0.1, 0.1), (5, 1, 1))
    half = np.sqrt(0.5)
    x = mesh.vertices @ np.array([[1, 0, 0], [0, half, -half], [0, half, half]]).T
    return TetMesh(np.stack([-x[:, 1], x[:, 0], x[:, 2]], axis=1) if across else x, mesh.tets)


def crossed_bars(gap, *, velocity=(0, 0, 0), friction=0.5, offset=(0.03, 0.02), **options):
    """A world of two crossed bars, the upper one `gap` above the lower one [m], and both bodies."""
    world = bare_world(**{"floor": None, "soft_contact": True, **options})
    contact = Contact(friction=friction)
    lower = world.add_body(bar(), FIRM, contact=contact)
    upper = world.add_body(
        bar(across=True),
        FIRM,
        position=(*offset, np.sqrt(2.0) * 0.1 + gap),
        velocity=velocity,
        contact=contact,
    )
    return world, lower, upper


@pytest.mark.parametrize("width", [0.04, 0.08])
def test_a_bar_narrower_than_the_triangles_of_a_ball_does_not_pass_between_its_vertices(width):
    """The bar hits the ball at the middle of triangles with edges of 0.17 m, sideways, and turns it away."""
    world = bare_world(floor=None, gravity=(0, 0, 0), soft_contact=True)
    ball = world.add_body(sphere(radius=0.3, resolution=2), FIRM)
    middle = ball.mesh.vertices[ball.mesh.surface].mean(axis=1)
    aim = 0.97 * middle[np.abs(middle[:, 2]).argmin()]
    way = np.array([aim[0], aim[1], 0.0]) / np.hypot(aim[0], aim[1])
    upright = box((width, width, 1.0), (1, 1, 3))
    bar = world.add_body(upright, FIRM, position=aim + 0.15 * way, velocity=-2.0 * way)
    world.build()
    deepest = 0.0
    for _ in range(30):
        world.step(DT)
        deepest = max(deepest, overlap(ball, bar))
    assert np.linalg.norm(ball.momentum()) > 0.1
    assert deepest < 0.01


def ridge_heights(lower, upper):
    """Height of the upper bar's lowest edge over the lower bar's highest one where they cross in plan [m]."""
    x, y = lower.positions().astype(np.float64), upper.positions().astype(np.float64)
    rest = bar().vertices
    top, bottom = np.flatnonzero(rest[:, 2] > 0.07), np.flatnonzero(rest[:, 2] < -0.07)
    a, b = x[top[np.argsort(rest[top, 0])]], y[bottom[np.argsort(rest[bottom, 0])]]
    for i in range(len(a) - 1):
        for k in range(len(b) - 1):
            d, e, r = a[i + 1] - a[i], b[k + 1] - b[k], b[k] - a[i]
            s, t = np.linalg.solve(np.stack([d[:2], -e[:2]], axis=1), r[:2])
            if 0 <= s <= 1 and 0 <= t <= 1:
                return float((b[k] + t * e - a[i] - s * d)[2])
    raise AssertionError("the edges do not cross")


def sharp_edges(mesh):
    rows, count = find_contact_edges(mesh.vertices, mesh.surface, mesh.edges)
    return rows[:count]


def test_contact_edges_are_the_sharp_convex_edges_of_a_solid():
    cube = box((1, 1, 1), (4, 4, 4))
    rows = sharp_edges(cube)
    ends = cube.vertices[rows[:, :2]]
    on_sides = (np.abs(np.abs(ends) - 0.5) < 1e-9).all(axis=1).sum(axis=1)
    assert len(rows) == 12 * 4
    assert (on_sides == 2).all()  # each lies on two sides of the cube
    # The corners of a row make triangles that face outwards.
    a, b, c, d = cube.vertices[rows].swapaxes(0, 1)
    for normal, middle in (
        (np.cross(b - a, c - a), (a + b + c) / 3),
        (np.cross(d - a, b - a), (a + b + d) / 3),
    ):
        assert ((normal * middle).sum(axis=1) > 0).all()
    ball = sphere(radius=0.5)
    assert len(sharp_edges(ball)) == 0
    assert len(find_contact_edges(ball.vertices, ball.surface, ball.edges)[0]) == 1.5 * len(ball.surface)


def test_no_contact_edge_lies_in_a_concave_corner():
    block = box((0.4, 0.4, 0.4), (2, 2, 2))
    middle = block.vertices[block.tets].mean(axis=1)
    used, tets = np.unique(block.tets[~((middle[:, 0] > 0) & (middle[:, 2] > 0))], return_inverse=True)
    mesh = TetMesh(block.vertices[used], tets.reshape(-1, 4))
    rows = sharp_edges(mesh)
    middles = mesh.vertices[rows[:, :2]].mean(axis=1)
    assert not ((np.abs(middles[:, 0]) < 1e-9) & (np.abs(middles[:, 2]) < 1e-9)).any()
    assert ((np.abs(middles[:, 0]) < 1e-9) & (np.abs(middles[:, 2] - 0.2) < 1e-9)).any()  # the step's edge


def test_all_edges_of_sheets_and_ropes_are_contact_edges():
    sheet, cord = cloth((1, 1), (10, 10), 0.3), rope(1.0, 10, 0.1)
    rows = sharp_edges(sheet)
    assert len(rows) == 121 + 200 - 1  # Euler: edges = vertices + triangles - 1
    assert (rows[:, 2:] == OF_SHEET).all()
    rows = sharp_edges(cord)
    assert rows.tolist() == [[i, i + 1, OF_ROPE, OF_ROPE] for i in range(10)]


def test_a_bar_stays_on_the_edge_of_another_bar():
    """Before, they fell through each other within 0.25 s."""
    world, lower, upper = crossed_bars(0.03)
    world.build()
    lower.pin(np.flatnonzero(np.abs(bar().vertices[:, 0]) > 0.59))
    for _ in range(30):
        world.step(DT)
        assert ridge_heights(lower, upper) > -0.002


def test_a_blow_of_edges_keeps_momentum_and_angular_momentum():
    world, lower, upper = crossed_bars(
        0.02, velocity=(0.4, 0.3, -2.0), friction=0.8, offset=(0.15, 0.1), gravity=(0, 0, 0)
    )
    world.build()
    momentum = upper.momentum().copy()
    turn = lower.angular_momentum() + upper.angular_momentum()
    energy = lower.kinetic_energy() + upper.kinetic_energy()
    for _ in range(30):
        world.step(DT)
    size = np.linalg.norm(momentum)
    assert np.abs(lower.momentum()).max() > 0.1 * size  # they met
    assert np.abs(lower.momentum() + upper.momentum() - momentum).max() < 1e-6 * size
    after = lower.angular_momentum() + upper.angular_momentum()
    assert np.abs(after - turn).max() < 1e-6 * max(np.abs(turn).max(), size * 0.6)
    assert lower.kinetic_energy() + upper.kinetic_energy() < energy


def test_a_rope_hangs_over_a_rope():
    world = bare_world(floor=None, soft_contact=True)
    mesh, contact = rope(2.0, 40, 0.5), Contact(thickness=THICKNESS)
    line = world.add_body(mesh, CORD, pinned=[0, 40], contact=contact)
    across = ParticleMesh(mesh.vertices[:, [1, 0, 2]], mesh.edges, mesh.masses)
    other = world.add_body(across, CORD, position=(0.07, 0.05, 0.1), contact=contact)
    world.build()
    for step in range(120):
        world.step(DT)
        if step % 10 == 0:
            assert rope_distance(line, other) > 0.5 * THICKNESS
    assert other.positions()[:, 2].max() > line.positions()[:, 2].min()


def test_a_snapshot_in_the_middle_of_edge_contact_continues_with_the_same_bits():
    world, lower, _ = crossed_bars(0.001)
    world.build()
    lower.pin(np.flatnonzero(np.abs(bar().vertices[:, 0]) > 0.59))
    for _ in range(6):
        world.step(DT)
    kept = world._built.state.soft.kept_edge_normal_impulse.to_numpy()
    assert (kept > 0).any()
    snapshot = world.snapshot()
    for _ in range(8):
        world.step(DT)
    expected = world.state_hash()
    world.restore(snapshot)
    for _ in range(8):
        world.step(DT)
    assert world.state_hash() == expected


def random_body(rng):
    """A bar, a plate or a block, some of them with large triangles."""
    shapes = (
        lambda: box((1.0, 0.12, 0.12), (int(rng.integers(2, 6)), 1, 1)),
        lambda: box((0.5, 0.5, 0.06), (2, 2, 1)),
        lambda: box(tuple(rng.uniform(0.15, 0.5, 3)), (1, 1, 2)),
    )
    return shapes[rng.integers(3)]()


def random_rotation(rng):
    quaternion = rng.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


@pytest.mark.parametrize(
    "seed", [1, 17, 22, 26, *(pytest.param(i, marks=pytest.mark.soak) for i in range(40, 80))]
)
def test_random_bars_plates_and_blocks_meet_without_overlap(seed):
    """Without edges against edges, half of these encounters overlapped by more than a centimetre."""
    rng = np.random.default_rng(seed)
    world = bare_world(floor=None, gravity=(0, 0, 0), soft_contact=True)
    speed = rng.uniform(1.0, 8.0)
    still = world.add_body(random_body(rng), RUBBER, rotation=random_rotation(rng))
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    start = 1.2 * way + rng.uniform(-0.1, 0.1, 3)
    thrown = world.add_body(
        random_body(rng), RUBBER, position=start, rotation=random_rotation(rng), velocity=-speed * way
    )
    world.build()
    momentum = thrown.momentum().copy()
    for _ in range(int(1.8 / speed * 60) + 10):
        world.step(DT)
        assert overlap(still, thrown) < 0.01
    assert not still.is_frozen
    assert not thrown.is_frozen
    change = still.momentum() + thrown.momentum() - momentum
    assert np.abs(change).max() < 2e-6 * np.linalg.norm(momentum)


def test_a_ring_hangs_on_a_rope():
    """The ring is smooth, and its tube hardly thicker than a segment of the rope is long."""
    world = bare_world(floor=None, soft_contact=True)
    line = world.add_body(rope(2.0, 40, 0.4), CORD, pinned=[0, 40], contact=Contact(thickness=THICKNESS))
    ring = world.add_body(
        torus(0.12, 0.03), RUBBER, rotation=(0, np.sqrt(0.5), 0, np.sqrt(0.5)), position=(0.01, 0.0, -0.02)
    )
    world.build()
    for _ in range(120):
        world.step(DT)
        assert ring.center_of_mass()[2] > line.positions()[:, 2].min() - 0.2
