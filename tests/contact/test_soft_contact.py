"""Bodies against each other and against themselves.

Without gravity and floor, two bodies and what passes between them are all there is.
"""

import numpy as np
import pytest

from taichi_soft import Contact, Material, SpringMaterial, beam, box, cloth, cloth_constants, sphere
from taichi_soft.world.bare import bare_world

DT = 1 / 60
SOFT = Material(young=2e5, poisson=0.3, density=1000.0, damping=60.0)


def world_of(*bodies, **options):
    """A world with soft contact, of (mesh, material, options of `add_body`)."""
    world = bare_world(**{"floor": None, "gravity": (0, 0, 0), "soft_contact": True, **options})
    for mesh, material, each in bodies:
        world.add_body(mesh, material, **each)
    world.build()
    return world


def run(world, seconds):
    for _ in range(round(seconds * 60)):
        world.step(DT)


def deepest(body, other):
    """How deep any vertex of `body` lies in a tetrahedron of `other` [m], the distance to its nearest face.

    Barycentric coordinates in float64, of every vertex in every tetrahedron.
    """
    x = body.positions().astype(np.float64)[np.unique(body.surface)]
    corners = other.positions().astype(np.float64)[other.tets]
    shape = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    inverse = np.linalg.inv(shape)
    rest = np.einsum("mab,mnb->mna", inverse, x[None] - corners[:, :1])
    shares = np.concatenate([1.0 - rest.sum(axis=2, keepdims=True), rest], axis=2)
    heights = 1.0 / np.linalg.norm(
        np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1), axis=2
    )
    inside = (shares > 0).all(axis=2)
    if not inside.any():
        return 0.0
    # Of those inside: how far from the outer surface, at the least over its triangles.
    vertices = other.positions().astype(np.float64)
    a, b, c = np.moveaxis(vertices[other.surface], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert (heights > 0).all()
    points = x[inside.any(axis=0)]
    planes = np.abs(np.einsum("fa,nfa->nf", normal, points[:, None] - a[None]))
    return float(planes.min(axis=1).max())


def totals(world):
    momentum = sum(body.momentum() for body in world.bodies)
    turn = sum(body.angular_momentum() for body in world.bodies)
    return momentum, turn


# The largest world comes first, so that the others reuse its kernels.
FILTERS = [
    ((1, 1), (1, 1)),
    ((1, 2), (2, 1)),
    ((1, 1), (2, 2)),
    ((1, 3), (2, 2)),
    ((1, 0), (1, 1)),
    ((5, 4), (4, 6)),
]


def test_bodies_touch_where_each_ones_mask_has_the_others_group():
    cube = box((0.3,) * 3, (1, 1, 1))
    bodies = []
    for row, pair in enumerate(FILTERS):
        for side, (group, mask) in zip((-1, 1), pair, strict=True):
            options = {"position": (0.3 * side, 0, 2 * row), "velocity": (-2.0 * side, 0, 0)}
            bodies.append((cube, SOFT, {**options, "contact": Contact(group=group, mask=mask)}))
    world = world_of(*bodies)
    run(world, 0.6)
    for pair, left, right in zip(FILTERS, world.bodies[::2], world.bodies[1::2], strict=True):
        (group, mask), (other_group, other_mask) = pair
        touch = bool(group & other_mask and other_group & mask)
        passed = left.center_of_mass()[0] > right.center_of_mass()[0]
        assert passed != touch, pair


@pytest.mark.parametrize("friction", [0.0, 0.8])
def test_a_collision_keeps_momentum_and_angular_momentum(friction):
    """Two bodies of different size and density, thrown past each other's middle; both spin."""
    contact = Contact(friction=friction)
    world = world_of(
        (box((1, 1, 1), (2, 2, 2)), SOFT, {"contact": contact}),
        (sphere(0.4, 2), Material(1e5, 0.3, 300.0, 20.0), {"contact": contact, "position": (1.3, 0.3, 0.2)}),
    )
    one, other = world.bodies
    one.set_velocity((2.0, 0.0, 0.0), (0.0, 0.5, -1.0))
    other.set_velocity((-6.0, 0.5, 0.0), (3.0, 0.0, 2.0))
    first, turn = totals(world)
    before = one.momentum()
    run(world, 1.0)
    last, end = totals(world)
    passed = np.linalg.norm(one.momentum() - before)
    assert passed > 100.0
    assert np.linalg.norm(last - first) < 1e-6 * 2000.0
    assert np.linalg.norm(end - turn) < 1e-4 * passed


def test_a_pile_of_five_blocks_stands_without_creeping():
    """8 s after it was set up, a hundredth of its size in no direction; without sinking into each other."""
    edge = 0.5
    block = box((edge,) * 3, (2, 2, 2))
    firm = Material(5e6, 0.3, 1000.0, 600.0)  # see test_piles for softer ones
    piled = [(block, firm, {"position": (0, 0, edge / 2 + 1.01 * edge * i)}) for i in range(5)]
    world = world_of(*piled, floor=0.0, gravity=(0, 0, -9.81))
    run(world, 2.0)
    before = [body.positions() for body in world.bodies]
    run(world, 8.0)
    for start, body in zip(before, world.bodies, strict=True):
        assert np.abs(body.positions() - start).max() < 0.01 * edge
    for lower, upper in zip(world.bodies[:-1], world.bodies[1:], strict=True):
        assert upper.center_of_mass()[2] > lower.center_of_mass()[2] + 0.9 * edge
        skin = lower.asset.surface_row[1]
        assert max(deepest(upper, lower), deepest(lower, upper)) < skin


def test_a_ball_dropped_on_a_soft_plate_bends_it_and_comes_to_rest_on_it():
    """The plate is held at two edges; in the end it carries the ball, with its middle below its edges."""
    plate = box((2.0, 2.0, 0.2), (6, 6, 1))
    held = np.flatnonzero(np.abs(plate.vertices[:, 0]) > 0.99)
    ball = sphere(0.3, 2)
    world = world_of(
        (plate, Material(1e6, 0.3, 1000.0, 100.0), {"pinned": held}),
        (ball, Material(3e5, 0.3, 1000.0, 40.0), {"position": (0.05, 0, 0.6)}),
        gravity=(0, 0, -9.81),
    )
    for body in world.bodies:
        body.set_linear_damping(1.0)
    run(world, 8.0)
    before = [body.positions() for body in world.bodies]
    run(world, 0.5)
    for start, body in zip(before, world.bodies, strict=True):
        assert np.abs(body.positions() - start).max() < 5e-3
    lower, upper = world.bodies
    assert lower.positions()[:, 2].min() < -0.12
    assert upper.center_of_mass()[2] > 0.25 + lower.positions()[:, 2].min()
    skin = 0.5 * (lower.asset.surface_row[1] + upper.asset.surface_row[1])
    assert deepest(upper, lower) < skin


def folding(itself):
    """A strip in the shape of a U, its ends thrown towards each other: the least gap between its two arms."""
    strip = beam(2.0, 0.2, 0.1, 1)
    world = world_of((strip, Material(1e5, 0.3, 1000.0, 3.0), {"contact": Contact(itself=itself)}))
    body = world.bodies[0]
    x, _, z = strip.vertices.T
    bend = np.clip(x / 0.2, -np.pi / 2, np.pi / 2)  # an arc of 0.2 m between two straight arms
    rest = x - 0.2 * bend
    bent = np.stack(
        [
            (0.2 - z) * np.sin(bend) + rest * np.cos(bend),
            strip.vertices[:, 1],
            0.2 - (0.2 - z) * np.cos(bend) + rest * np.sin(bend),
        ],
        axis=1,
    )
    arms = np.abs(bend) > 1.5
    velocity = np.where(
        arms[:, None] * (np.abs(x)[:, None] > 0.6), np.stack([-np.sign(x), 0 * x, 0 * x], 1), 0.0
    )
    body.set_motion(bent, 3.0 * velocity)
    upper, lower = x > 0.6, x < -0.6
    least = np.inf
    for _ in range(30):
        world.step(DT)
        now = body.positions()
        least = min(least, now[upper, 0].mean() - now[lower, 0].mean())
    return least, body


def test_the_halves_of_a_folded_strip_meet_where_contact_with_itself_is_on_and_pass_where_it_is_off():
    on, body = folding(True)
    assert on > 0.06  # its own thickness is 0.1 m
    assert not body.is_frozen
    assert folding(False)[0] < 0.0


def test_a_body_of_5_cm_rests_on_one_of_2_m():
    """Between its vertices: its own vertices are what the big one's triangles hold."""
    world = world_of(
        (box((2, 2, 2), (2, 2, 2)), Material(1e6, 0.3, 1000.0, 600.0), {"position": (0, 0, 1.0)}),
        (box((0.05,) * 3, (1, 1, 1)), Material(1e5, 0.3, 1000.0, 0.3), {"position": (0.37, 0.21, 2.08)}),
        floor=0.0,
        gravity=(0, 0, -9.81),
    )
    big, small = world.bodies
    run(world, 3.0)
    before = small.positions()
    run(world, 0.5)
    assert np.abs(small.positions() - before).max() < 2e-3
    skin = 0.5 * (big.asset.surface_row[1] + small.asset.surface_row[1])
    gap = small.positions()[:, 2].min() - big.positions()[:, 2].max()
    assert -0.02 < gap < 1.2 * skin
    assert deepest(small, big) == 0.0


@pytest.mark.soak
@pytest.mark.filterwarnings("ignore::taichi_soft.FrozenBodyWarning")
def test_a_coarse_plate_rests_on_a_mesh_that_has_far_more_triangles_near_each_of_its_vertices():
    """More than a search stores for a vertex: 16."""
    block, plate = box((0.4, 0.4, 0.1), (24, 24, 2)), box((0.3, 0.3, 0.02), (1, 1, 1))
    world = world_of(
        (block, SOFT, {"position": (0, 0, 0.05)}),
        (plate, SOFT, {"position": (0, 0, 0.113)}),
        gravity=(0, 0, -9.81),
        floor=0.0,
    )
    run(world, 1.2)
    below, above = world.bodies
    state = world._built.state
    first = state.body_outer.to_numpy()[above.index][0] + state.soft.body_edges.to_numpy()[above.index][0]
    found = state.soft.found_count.to_numpy()[first:][:8]
    assert (found == 16).any()  # only the nearest 16 are stored
    assert state.soft.body_lost.to_numpy()[above.index] < 1.0
    assert deepest(above, below) < 1e-3
    assert np.linalg.norm(above.velocities(), axis=1).max() < 0.05
    assert below.positions()[:, 2].max() - 2e-3 < above.positions()[:, 2].min()


APART = [
    # The corner of a thin sheet, and a turned cube beside it, of which no vertex is in the sheet's box.
    (box((0.3, 0.3, 0.02), (8, 8, 1)), box((0.1,) * 3, (3, 3, 3)), (0.2107, 0.2107, 0)),
    (box((0.3,) * 3, (1, 1, 1)), box((0.3,) * 3, (1, 1, 1)), (0.35, 0.35, 0)),
]


@pytest.mark.parametrize(("mesh", "beside", "position"), APART)
def test_bodies_whose_boxes_meet_where_neither_has_a_vertex_pass_each_other(mesh, beside, position):
    turn = (0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8))
    world = world_of((mesh, SOFT, {}), (beside, SOFT, {"position": position, "rotation": turn}))
    start = [body.positions() for body in world.bodies]
    run(world, 0.1)
    for body, before in zip(world.bodies, start, strict=True):
        assert np.abs(body.positions() - before).max() < 1e-5


def test_where_a_body_explodes_it_is_frozen_alone_and_the_others_go_on():
    cube = box((0.5,) * 3, (2, 2, 2))
    world = world_of(
        *((cube, SOFT, {"position": (0, 0, 0.26 + 0.55 * i)}) for i in range(3)),
        floor=0.0,
        gravity=(0, 0, -9.81),
        retries=0,
    )
    middle = world.bodies[1]
    run(world, 0.5)
    hot = middle.velocities()
    hot[0] = 3e3
    middle.set_motion(middle.positions(), hot)
    world.step(DT)
    assert [body.is_frozen for body in world.bodies] == [False, True, False]
    still = middle.positions()
    lower, upper = world.bodies[0], world.bodies[2]
    places = lower.center_of_mass(), upper.center_of_mass()
    run(world, 1.0)
    np.testing.assert_array_equal(middle.positions(), still)
    assert [body.is_frozen for body in world.bodies] == [False, True, False]
    for body, place in zip((lower, upper), places, strict=True):
        assert np.abs(body.center_of_mass() - place).max() < 0.5
    assert upper.center_of_mass()[2] > still[:, 2].max() > lower.center_of_mass()[2]


@pytest.mark.parametrize(("slope", "slides"), [(0.48, False), (0.6, True)])
def test_a_block_slides_on_another_where_the_slope_exceeds_the_mean_friction(slope, slides):
    """Coulomb: sqrt(0.25 x 1) = 0.5, and g (sin - 0.5 cos) of acceleration beyond it."""
    plate = box((3.0, 0.5, 0.1), (12, 2, 1))
    block = box((0.4, 0.3, 0.1), (3, 2, 1))
    stiff = Material(2e6, 0.2, 1000.0, 200.0)
    angle = np.arctan(slope)
    world = world_of(
        (plate, stiff, {"pinned": np.arange(len(plate.vertices)), "contact": Contact(friction=0.25)}),
        (block, stiff, {"position": (-0.8, 0, 0.101), "contact": Contact(friction=1.0)}),
        gravity=(9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle)),
    )
    body = world.bodies[1]
    run(world, 1.25)  # it falls by 1 mm, and slides until friction stops it
    start, speed = body.center_of_mass()[0], body.momentum()[0] / body.masses.sum()
    run(world, 0.5)
    way = body.center_of_mass()[0] - start
    if slides:
        expected = 9.81 * (np.sin(angle) - 0.5 * np.cos(angle))
        assert (way - 0.5 * speed) / 0.125 == pytest.approx(expected, rel=0.05)
    else:
        assert abs(way) < 1e-5


@pytest.mark.parametrize(("size", "speed"), [(0.1, 30), (0.3, 50), (0.2, 60)])
def test_what_is_thrown_at_a_thin_soft_plate_bounces_off_it(size, speed):
    """Up to 0.8 m a frame, seventeen times the plate's thickness; at 80 m/s some get stuck in it."""
    plate = box((1.5, 0.05, 1.5), (8, 1, 8))
    rim = np.flatnonzero(np.abs(plate.vertices[:, [0, 2]]).max(axis=1) > 0.74)
    ball = sphere(size / 2, 3)
    world = world_of(
        (plate, Material(1e6, 0.3, 1000.0, 100.0), {"pinned": rim}),
        (ball, Material(1e6, 0.3, 300.0, 20.0), {"position": (0.02, 1.0, 0.03), "velocity": (0, -speed, 0)}),
    )
    target, thrown = world.bodies
    for _ in range(30):
        world.step(DT)
        assert thrown.positions()[:, 1].mean() > target.positions()[:, 1].min()
    assert thrown.positions()[:, 1].min() > target.positions()[:, 1].max() + size  # thrown back
    assert not thrown.is_frozen
    assert not target.is_frozen


@pytest.mark.soak
@pytest.mark.parametrize("young", [1e5, 2e7])
def test_a_ball_thrown_on_a_sheet_gains_no_energy_however_short_the_substeps(young):
    """Before contact there is only kinetic energy. A stiff ball needs 13 times the substeps of a soft one."""
    mesh = cloth((0.6, 0.6), (12, 12), 1.3)
    springs = cloth_constants(mesh, (12, 12), tensile=4000.0, shear=2000.0, bend=40.0)
    border = np.flatnonzero(np.abs(mesh.vertices[:, :2]).max(axis=1) > 0.29)
    world = bare_world(soft_contact=True, floor=None, gravity=(0, 0, 0))
    sheet = world.add_body(
        mesh, SpringMaterial(springs, damping=0.05), pinned=border, contact=Contact(thickness=5e-3)
    )
    ball = world.add_body(
        sphere(0.06), Material(young, 0.3, 500.0), position=(0.01, 0.02, 0.08), velocity=(0, 0, -2.4)
    )
    world.build()
    start = ball.kinetic_energy()
    for _ in range(40):
        world.step(1 / 240)
        energy = sum(body.kinetic_energy() + body.elastic_energy() for body in (sheet, ball))
        assert energy < 1.05 * start
    assert ball.velocities()[:, 2].mean() > 0.5
    assert ball.positions()[:, 2].min() > sheet.positions()[:, 2].min()
