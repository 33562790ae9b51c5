"""Bodies that are cut in two or cut open: the parts, their motion, and refused cuts."""

import numpy as np
import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Contact,
    Material,
    OptionError,
    Plasticity,
    SoftBodyAsset,
    StateError,
    Stiffness,
    TetMesh,
    box,
    surface_mesh,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT = 1 / 60
BAR = box((2.0, 0.5, 0.5), (8, 2, 2))
SPREAD = np.linspace(0.8, 1.2, len(BAR.tets))
JELLY = Material(1e5, 0.3, 1000.0 * SPREAD, 20.0, damping_ratio=0.0)
ALONG = np.array([0.03, 0.0, 0.0]), np.array([1.0, 0.1, 0.2])
OPEN = [[0.03, -1.0, 0.05], [0.03, 1.0, 0.05], [0.03, 0.0, 3.0]]

MODES = {
    "leapfrog": {},
    "implicit": {"integrator": "implicit_euler"},
    "contact": {"soft_contact": True},
}


def bar(**options):
    return SoftBodyAsset(BAR, JELLY, **{"spare_vertices": 60, **options})


def make(mode="leapfrog", count=3, asset=None, **options):
    """A built world without gravity, with a bar that swings, turns and flies, and empty slots."""
    world = bare_world(floor=None, gravity=(0, 0, 0), **MODES[mode], **options)
    asset = asset or bar()
    world.reserve(asset, count)
    body = world.spawn(asset, velocity=(1.0, 0.0, 0.5), angular_velocity=(2.0, 1.0, 3.0))
    world.build()
    for _ in range(5):
        world.step(DT, 12)
    return world, body


@pytest.fixture(scope="module")
def swinging():
    """A new swinging bar at each call, in a world of three slots."""
    world, body = make()
    first = bits(body)
    start = body.positions().astype(float), body.velocities().astype(float)

    def again():
        for each in world.bodies:
            world.despawn(each)
        body = world.spawn(world._context.slots.assets[0])
        body.set_motion(*start)
        return world, body

    again.first = first
    return again


def totals(*bodies):
    """Mass, momentum, angular momentum, kinetic and elastic energy, volume: sums over bodies."""
    rows = [
        np.r_[
            b.masses.sum(),
            b.momentum(),
            b.angular_momentum(),
            b.kinetic_energy(),
            b.elastic_energy(),
            b.volume(),
        ]
        for b in bodies
    ]
    return np.sum(rows, axis=0)


def bits(*bodies):
    return b"".join(b.positions().tobytes() + b.velocities().tobytes() for b in bodies)


@pytest.mark.parametrize("blade", [{"plane": ALONG}, {"triangle": OPEN}])
def test_a_cut_changes_neither_mass_nor_momentum_nor_energy(swinging, blade):
    world, body = swinging()
    before, where = totals(body), body.positions()
    fallen = body.cut(**blade)
    assert len(fallen) == int("plane" in blade)
    np.testing.assert_allclose(totals(body, *fallen), before, rtol=1e-6, atol=1e-6 * np.abs(before).max())
    assert totals(body, *fallen)[0] == pytest.approx(before[0], rel=1e-14)
    assert totals(body, *fallen)[8] == pytest.approx(before[8], rel=1e-9)
    for each in (body, *fallen):
        np.testing.assert_array_equal(each.positions(), where[each.vertex_origins])
        np.testing.assert_array_equal(BAR.tets[each.tet_origins], each.vertex_origins[each.tets])
        assert each.topology_version == 1
    for _ in range(30):
        world.step(DT, 24)
    after = totals(body, *fallen)
    np.testing.assert_allclose(after[:4], before[:4], atol=2e-5 * np.abs(before[1:4]).max())
    np.testing.assert_allclose(after[4:7], before[4:7], atol=1e-4 * np.abs(before[4:7]).max())


def half(side):
    """Return the tetrahedra on one side as a mesh with a material, and the indices of their vertices."""
    used, corners = np.unique(BAR.tets[side], return_inverse=True)
    mesh = TetMesh(BAR.vertices[used], corners.reshape(-1, 4))
    return SoftBodyAsset(mesh, Material(1e5, 0.3, 1000.0 * SPREAD[side], 20.0, damping_ratio=0.0)), used


@pytest.mark.parametrize("mode", ["leapfrog", "implicit"])
def test_parts_move_as_bodies_built_that_way(mode):
    """Cut at rest, along the centres of tetrahedra; then swung in the same way, in one world."""
    side = (BAR.vertices[BAR.tets].mean(axis=1) - ALONG[0]) @ ALONG[1] > 0
    world = bare_world(floor=None, gravity=(0, 0, 0), **MODES[mode])
    asset, halves = bar(), [half(side), half(~side)]
    world.reserve(asset, 2)
    body = world.spawn(asset)
    twins = []
    for twin, _ in halves:
        world.reserve(twin, 1)
        twins.append(world.spawn(twin))
    world.build()
    parts = sorted((body, *body.cut(plane=ALONG)), key=lambda part: -part.center_of_mass()[0])
    bend = np.array([[1.1, 0.1, 0.0], [0.0, 0.9, 0.2], [0.1, 0.0, 1.0]])
    for part, twin, (_, used) in zip(parts, twins, halves, strict=True):
        np.testing.assert_array_equal(part.vertex_origins[np.argsort(part.vertex_origins)], used)
        np.testing.assert_allclose(twin.masses, part.masses[np.argsort(part.vertex_origins)], rtol=1e-12)
        for each, vertices in ((part, part.vertex_origins), (twin, used)):
            x = BAR.vertices[vertices]
            each.set_motion(x @ bend.T, x @ bend.T @ bend)
    for _ in range(10):
        world.step(DT, 24)
        for part, twin in zip(parts, twins, strict=True):
            order = np.argsort(part.vertex_origins)
            np.testing.assert_allclose(
                part.positions()[order], twin.positions(), atol=1e-5 if mode == "implicit" else 2e-6
            )


def test_the_faces_of_a_cut_hit_each_other():
    """Halves of a bar that fly together stop each other and pass no momentum to anybody."""
    world, body = make("contact", asset=bar(contact=Contact(thickness=0.01)))
    body.set_motion(BAR.vertices, np.zeros_like(BAR.vertices))
    (fallen,) = body.cut(plane=((0.03, 0, 0), (1, 0, 0)))
    left, right = sorted((body, fallen), key=lambda b: b.center_of_mass()[0])
    left.set_motion(left.positions() - np.array([0.05, 0, 0]), np.tile([1.0, 0, 0], (left.vertex_count, 1)))
    right.set_motion(right.positions(), np.tile([-1.0, 0, 0], (right.vertex_count, 1)))
    before = left.momentum() + right.momentum()
    closest = np.inf
    for _ in range(40):
        world.step(DT, 12)
        closest = min(closest, right.positions()[:, 0].min() - left.positions()[:, 0].max())
    assert closest < 0.05
    np.testing.assert_allclose(left.momentum() + right.momentum(), before, atol=0.05)
    assert right.center_of_mass()[0] - left.center_of_mass()[0] > 0.9
    assert right.momentum()[0] - left.momentum()[0] > 50.0  # they fly apart


def test_a_bar_falls_into_two_bodies_that_part(swinging):
    world, body = swinging()
    (fallen,) = body.cut(plane=ALONG)
    assert fallen.is_alive
    assert world.bodies == (body, fallen)
    assert fallen.asset is body.asset
    assert len(body.tets) + len(fallen.tets) == len(BAR.tets)
    assert len(body.tets) >= len(fallen.tets)
    assert not set(body.tet_origins) & set(fallen.tet_origins)
    body.set_motion(body.positions(), np.zeros((body.vertex_count, 3)))
    push = np.tile([3.0, 0.0, 0.0], (fallen.vertex_count, 1))
    fallen.set_motion(fallen.positions(), push)
    gap = fallen.center_of_mass() - body.center_of_mass()
    for _ in range(30):
        world.step(DT, 24)
    np.testing.assert_allclose(fallen.center_of_mass() - body.center_of_mass() - gap, [1.5, 0, 0], atol=1e-3)


def test_surfaces_are_closed_after_cuts_one_after_the_other(swinging):
    _, body = swinging()
    body.cut(triangle=OPEN)
    assert body.vertex_count > len(BAR.vertices)
    np.testing.assert_array_equal(body.vertex_origins[: len(BAR.vertices)], np.arange(len(BAR.vertices)))
    fallen = body.cut(plane=((-0.4, 0, 0), (1, 0, 0.3)))
    fallen += body.cut(plane=((0.5, 0, 0), (1, 0.2, 0.3)))
    assert body.topology_version == 3
    for each in (body, *fallen):
        surface = surface_mesh(each.mesh, each.positions())
        assert surface.is_watertight
        assert surface.volume == pytest.approx(each.volume(), rel=1e-6)
        assert surface.volume > 0
        np.testing.assert_array_equal(each.surface, each.mesh.surface)
    assert sum(each.mesh.volume for each in (body, *fallen)) == pytest.approx(BAR.volume, rel=1e-12)


def test_queries_see_the_new_faces(swinging):
    """A ray along the bar hits its end, and after the cut, from within the gap, the face of the cut."""
    world, body = swinging()
    rest = np.zeros_like(BAR.vertices)
    body.set_motion(BAR.vertices, rest)
    (fallen,) = body.cut(plane=((0.03, 0, 0), (1, 0, 0)))
    left, right = sorted((body, fallen), key=lambda b: b.center_of_mass()[0])
    right.set_motion(right.positions() + np.array([1.0, 0, 0]), np.zeros((right.vertex_count, 3)))
    inward = world.raycast((0.6, 0.1, 0.1), (-1, 0, 0))
    outward = world.raycast((0.6, 0.1, 0.1), (1, 0, 0))
    assert (inward.body, outward.body) == (left, right)
    assert inward.point[0] == pytest.approx(0.0, abs=0.26)
    assert outward.point[0] == pytest.approx(1.0, abs=0.26)
    lower, upper = right.aabb()
    assert upper[0] == pytest.approx(2.0)
    assert lower[0] > 0.7


def test_a_hole_cut_by_a_triangle_opens_but_does_not_part(swinging):
    _, body = swinging()
    assert body.cut(triangle=OPEN) == ()
    opened = BAR.vertices[body.vertex_origins[len(BAR.vertices) :]]
    assert len(opened) > 0
    assert (opened[:, 2] > -0.1).all()
    assert (np.abs(opened[:, 0]) < 0.26).all()
    assert body.cut(triangle=np.array(OPEN) + 50.0) == ()
    assert body.topology_version == 1  # a cut outside the body changes nothing


def test_a_slot_in_which_a_part_was_takes_a_whole_body_again(swinging):
    """After cuts and removals, a new body moves like the first body before any cut, bit by bit."""
    world, body = swinging()
    for each in (body, *body.cut(plane=ALONG)):
        world.despawn(each)
    for _ in range(3):
        body = world.spawn(body.asset, velocity=(1.0, 0.0, 0.5), angular_velocity=(2.0, 1.0, 3.0))
        for _ in range(5):
            world.step(DT, 12)
        assert bits(body) == swinging.first
        assert not body.is_cut
        assert len(body.tets) == len(BAR.tets)


@pytest.mark.parametrize("young", [1e5, 4e5])
def test_a_slot_in_which_a_part_of_another_material_was_takes_a_body_of_its_own_kind(swinging, young):
    """A new body has nothing of the damping or speed of sound of the earlier part, bit by bit."""
    world, body = swinging()
    body.set_material(Material(young, 0.3, 1000.0 * SPREAD, 20.0, damping_ratio=0.5))
    (piece,) = body.cut(plane=ALONG)
    slots = [body.index, piece.index]
    before = world.snapshot()
    for each in (body, piece):
        world.despawn(each)
    for index in slots:  # the lowest free slot is used first
        body = world.spawn(body.asset, velocity=(1.0, 0.0, 0.5), angular_velocity=(2.0, 1.0, 3.0))
        assert body.index == index
        for _ in range(5):
            world.step(DT, 12)
        assert bits(body) == swinging.first
    world.restore(before)
    assert world.snapshot() == before  # including the speed of sound of each body
    for each in world.bodies:
        assert each.material.damping_ratio == 0.5
        world.despawn(each)
    again = world.spawn(body.asset, velocity=(1.0, 0.0, 0.5), angular_velocity=(2.0, 1.0, 3.0))
    for _ in range(5):
        world.step(DT, 12)
    assert bits(again) == swinging.first


def test_cuts_are_the_same_every_time(swinging):
    told = []
    for _ in range(2):
        world, body = swinging()
        parts = (body, *body.cut(plane=ALONG))
        for _ in range(5):
            world.step(DT, 24)
        told.append(bits(*parts))
    assert told[0] == told[1]


def everything(world, *bodies):
    state = world._built.state
    fields = (
        "tet_vertices",
        "edge_vertices",
        "edge_blocks",
        "triangle_vertices",
        "outer_particle",
        "body_particles",
    )
    return bits(*bodies), [getattr(state, name).to_numpy().tobytes() for name in fields], world.bodies


def test_what_does_not_fit_is_refused_and_changes_nothing():
    """After a refused cut, the body moves exactly like a body without a cut, bit by bit."""
    world, body = make(count=1, asset=bar(spare_vertices=4))
    middle = body.center_of_mass()
    start = body.positions(), body.velocities()
    told = []
    for tries in (False, True):
        body.set_motion(*start)
        if tries:
            before = everything(world, body)
            with pytest.raises(StateError, match=r"2 pieces.*0 slots"):
                body.cut(plane=ALONG)
            with pytest.raises(StateError, match=r"\d+ vertices.*body 0.*85.*spare_vertices"):
                body.cut(
                    triangle=middle + np.array([[-0.7, -9.0, 0.03], [-0.7, 9.0, 0.03], [9.0, 0.0, 0.03]])
                )
            assert everything(world, body) == before
            assert body.topology_version == 0
        for _ in range(3):
            world.step(DT, 12)
        told.append(bits(body))
    assert told[0] == told[1]


@pytest.mark.parametrize(
    ("blade", "message"),
    [
        ({}, "one of the two"),
        ({"plane": ALONG, "triangle": OPEN}, "one of the two"),
        ({"plane": ((0, 0, 0), (0, 0, 0))}, "normal is zero"),
        ({"plane": ((0, 0, np.nan), (0, 0, 1))}, "point must be finite"),
        ({"plane": (0, 0, 1)}, r"plane.*\(point, normal\)"),
        ({"plane": 3}, r"plane.*\(point, normal\)"),
        ({"triangle": np.zeros((3, 3))}, "triangle has no area"),
        ({"triangle": np.zeros((2, 3))}, "triangle must have shape"),
        ({"triangle": [[0, 0, 0], [1, 1, 1], [2, 2, 2]]}, "triangle has no area"),
    ],
)
def test_bad_blades_are_refused(swinging, blade, message):
    _, body = swinging()
    with pytest.raises(OptionError, match=message):
        body.cut(**blade)
    assert body.topology_version == 0


def test_bodies_that_cannot_be_cut_say_so():
    world = bare_world(floor=None)
    whole = world.add_body(BAR, JELLY)
    ready = world.add_body(BAR, JELLY, spare_vertices=50)
    with pytest.raises(OptionError, match="spare_vertices"):
        whole.cut(plane=ALONG)
    with pytest.raises(StateError, match="not built"):
        ready.cut(plane=ALONG)
    with pytest.raises(OptionError, match=r"'springs'.*spare_vertices"):
        SoftBodyAsset(BAR, Material(1e5, 0.3, 1000.0, damping_ratio=0.0), law="springs", spare_vertices=5)
    with pytest.raises(OptionError, match=r"spare_vertices.*whole number"):
        bar(spare_vertices=-1)
    flat = bare_world(schedule="flat")
    flat.reserve(bar(), 1)
    with pytest.raises(OptionError, match=r"'flat'.* cut"):
        flat.build()


@pytest.mark.guard
def test_a_part_keeps_its_pins_its_fibres_and_its_dents():
    """Anisotropic and pinned; and, in the same world, one that has flowed."""
    frames = np.tile(np.eye(3), (len(BAR.tets), 1, 1))
    wood = AnisotropicMaterial(
        Stiffness.orthotropic((2e5, 1e5, 1e5), (0.2, 0.2, 0.2), (4e4,) * 3),
        1000.0,
        20.0,
        frames,
        damping_ratio=0.0,
    )
    held = np.flatnonzero(BAR.vertices[:, 0] < -0.99)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    fibres = SoftBodyAsset(BAR, wood, pinned=held, spare_vertices=60)
    clay = SoftBodyAsset(BAR, JELLY, plasticity=Plasticity(yield_strain=0.02), spare_vertices=60)
    for asset in (fibres, clay):
        world.reserve(asset, 2)
    pinned, dented = world.spawn(fibres), world.spawn(clay)
    world.build()
    dented.set_motion(BAR.vertices * [1.0, 1.2, 0.9], np.zeros_like(BAR.vertices))
    world.step(1e-4, 1)
    strains, energy = dented.plastic_strains(), dented.elastic_energy()
    parts = (dented, *dented.cut(plane=ALONG))
    assert strains.min() > 0.05
    for part in parts:
        np.testing.assert_allclose(part.plastic_strains(), strains[part.tet_origins], atol=1e-6)
    assert sum(part.elastic_energy() for part in parts) == pytest.approx(energy, rel=1e-6)
    fallen = pinned.cut(plane=ALONG)
    with_pins = [part for part in (pinned, *fallen) if len(part.pinned)]
    assert len(with_pins) == 1
    np.testing.assert_array_equal(with_pins[0].vertex_origins[with_pins[0].pinned], held)
    for part in (pinned, *fallen):
        part.set_motion(part.positions() + 0.1, np.ones((part.vertex_count, 3)) * (part not in with_pins))
    where = with_pins[0].positions()
    for _ in range(5):
        world.step(DT, 24)
    np.testing.assert_array_equal(with_pins[0].positions()[with_pins[0].pinned], where[with_pins[0].pinned])


def test_what_is_held_is_not_cut_and_what_is_watched_is_watched_on(swinging):
    world, body = swinging()
    grab = body.grab(0)
    with pytest.raises(StateError, match=r"body 0.*grabs.*release"):
        body.cut(plane=ALONG)
    grab.release()
    body.watch_stress(10.0)
    world.step(DT, 24)
    world.drain_events()
    fallen = body.cut(plane=ALONG)
    world.step(DT, 24)
    (event,) = world.drain_events()
    assert event.body is body
    stress = body.tet_stress()
    np.testing.assert_allclose(event.stress, stress[event.tetrahedra], rtol=1e-3, atol=1.0)
    assert len(event.tetrahedra) == (stress > 10.0).sum()
    assert len(fallen) == 1


def test_every_piece_hangs_on_by_what_it_has_of_what_was_attached(swinging):
    """Loads add up to that of before the cut; each piece then goes with the frame, and can be released."""
    world, body = swinging()
    ends, middle = np.flatnonzero(np.abs(BAR.vertices[:, 0]) > 0.99), np.flatnonzero(BAR.vertices[:, 0] == 0)
    frame, other = world.add_frame(), world.add_frame((5, 0, 0))
    hold, clamp = body.attach(ends, frame, two_way=True), body.attach(middle, other)
    world.step(DT, 24)
    load, turn, where = hold.force, hold.torque, body.positions()
    assert np.abs(load).max() > 10.0
    (fallen,) = body.cut(plane=((0.03, 0, 0), (1, 0, 0)))
    (first, second) = (each.attachments for each in (body, fallen))
    assert first == (hold, clamp)
    assert [each.frame for each in second] == [frame, other]
    assert [each.two_way for each in second] == [True, False]
    np.testing.assert_allclose(hold.force + second[0].force, load, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(hold.torque + second[0].torque, turn, rtol=1e-5, atol=1e-3)
    for each, (outer, inner) in ((body, first), (fallen, second)):
        assert set(each.vertex_origins[outer.particles]) == set(each.vertex_origins) & set(ends)
        assert set(each.vertex_origins[inner.particles]) == set(each.vertex_origins) & set(middle)
        assert each.pinned.tolist() == sorted([*outer.particles, *inner.particles])
    data = world.snapshot()
    frame.move_to((0.1, 0, 0.2))
    world.step(DT, 24)
    name = world.state_hash()
    for each, (outer, inner) in ((body, first), (fallen, second)):
        start = where[each.vertex_origins]
        for held, way in ((outer, [0.1, 0, 0.2]), (inner, [0, 0, 0])):
            moved = each.positions()[held.particles] - start[held.particles]
            np.testing.assert_allclose(moved, np.tile(way, (len(moved), 1)), atol=1e-5)
    world.restore(data)
    frame.move_to((0.1, 0, 0.2))
    world.step(DT, 24)
    assert world.state_hash() == name
    assert fallen.attachments == second
    second[0].release()
    other.remove()
    assert len(fallen.pinned) == 0
    assert set(body.vertex_origins[body.pinned]) == set(body.vertex_origins) & set(ends)
    world.despawn(fallen)
    assert hold.is_attached
    world.step(DT, 24)


def test_parts_keep_gravity_scale_and_what_pushes_them(swinging):
    world, body = swinging()
    rest = np.zeros_like(BAR.vertices)
    body.set_motion(BAR.vertices, rest)
    body.set_gravity_scale(-2.0)
    body.apply_force((30.0, 0.0, 0.0))
    parts = (body, *body.cut(plane=ALONG))
    world.step(DT, 24)
    assert sum(part.momentum() for part in parts) == pytest.approx([30.0 * DT, 0, 0], abs=1e-4)
    assert [part.gravity_scale for part in parts] == [-2.0, -2.0]


def test_the_stable_step_of_a_part_is_its_own(swinging):
    world, body = swinging()
    whole, substeps = body.stable_step.limit, world.stable_substeps(DT)
    (fallen,) = body.cut(plane=ALONG)
    limits = [part.stable_step.limit for part in (body, fallen)]
    assert limits[0] != limits[1]
    assert whole < max(limits)
    for part, limit in zip((body, fallen), limits, strict=True):
        mesh = TetMesh(BAR.vertices[part.vertex_origins], part.tets)
        alone = SoftBodyAsset(mesh, part.material)
        assert alone.stable_step.limit == pytest.approx(limit, rel=1e-6)
    shortest = 0.9 * min(*limits, whole)
    assert world.stable_substeps(DT) == int(np.ceil(DT / shortest)) >= substeps
