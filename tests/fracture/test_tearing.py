"""Bodies that tear during the simulation: only where the stress exceeds the limit."""

import numpy as np
import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    MaterialError,
    OptionError,
    SoftBodyAsset,
    Stiffness,
    StressExceeded,
    Tearing,
    TetMesh,
    Torn,
    box,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
STRENGTH = 3e4
JELLY = Material(1e5, 0.3, 1000.0, 60.0)


def waisted_bar():
    """A bar of 2 m along x whose upper half is missing between x = 0.5 and 0.75."""
    whole = box((2.0, 0.5, 0.5), (8, 2, 2))
    centers = whole.vertices[whole.tets].mean(axis=1)
    kept = ~((centers[:, 2] > 0) & (centers[:, 0] > 0.5) & (centers[:, 0] < 0.75))
    used, corners = np.unique(whole.tets[kept], return_inverse=True)
    return TetMesh(whole.vertices[used], corners.reshape(-1, 4))


BAR = waisted_bar()
ENDS = np.flatnonzero(np.abs(BAR.vertices[:, 0]) > 0.99)


def asset(**options):
    usual = {"pinned": ENDS, "spare_vertices": 60, "tearing": Tearing(STRENGTH)}
    return SoftBodyAsset(BAR, JELLY, **usual | options)


@pytest.mark.parametrize("turn", [np.eye(3), np.array([[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]])])
@pytest.mark.parametrize(
    "law",
    [
        pytest.param("virial", marks=pytest.mark.soak),
        pytest.param("st_venant_kirchhoff", marks=pytest.mark.soak),
        "neo_hookean",
    ],
)
def test_a_bar_holds_just_below_its_strength_and_tears_just_above_it_by_its_own_law(law, turn):
    """Stretched to 1.3 along its axis, in a step that moves nothing."""
    s, m, lame, mu = 1.3, 4 / 3 * JELLY.lame_mu, JELLY.lame_lambda, JELLY.lame_mu
    strain = (s**2 - 1) / 2
    stress = {
        "virial": (lame + 2 * mu) * strain,
        "st_venant_kirchhoff": s * (lame + 2 * mu) * strain,
        "neo_hookean": m * (1 - 1 / (s**2 + 3)) * s + (lame + 5 / 6 * mu) * (s - 1) - mu,
    }[law]
    mesh = box((3, 1, 1), cells=(3, 1, 1))
    world = bare_world(floor=None, gravity=(0, 0, 0))
    kinds = [
        SoftBodyAsset(mesh, JELLY, law=law, tearing=Tearing(part * stress), spare_vertices=40)
        for part in (1.002, 0.998)
    ]
    for kind in kinds:
        world.reserve(kind, 3)
    world.build()
    bodies = [world.spawn(kind) for kind in kinds]
    for body in bodies:
        body.set_motion((mesh.vertices * [s, 1, 1]) @ turn.T, np.zeros_like(mesh.vertices))
    world.step(1e-5, 1)
    assert [body.topology_version for body in bodies] == [0, 1]
    parts = [part for part in world.bodies if part.asset is bodies[1].asset]
    assert sum(len(part.tets) for part in parts) == len(mesh.tets)
    copies = np.concatenate([part.vertex_origins for part in parts])
    torn = np.flatnonzero(np.bincount(copies) > 1)
    assert len(torn) >= 3
    assert (np.abs(mesh.vertices[torn, 0]) < 1).all()  # across the axis, and at neither end


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_bar_that_is_drawn_to_a_line_tears_without_a_warning():
    """Its faces have no normal there. By the virial law nothing drives it back."""
    world, kind = bare_world(floor=None, gravity=(0, 0, 0)), asset(law="virial")
    world.reserve(kind, 1)
    world.build()
    body = world.spawn(kind)
    body.set_motion(BAR.vertices * [1.8, 0.0, 0.0], np.zeros_like(BAR.vertices))
    world.step(1e-5, 1)
    assert body.topology_version == 1


@pytest.fixture(scope="module")
def world():
    """Return a world with a pool of three bars that tear, and of one bar that cannot fall apart."""
    world = bare_world(floor=None, gravity=(0, 0, 0))
    world.assets = asset(), asset(spare_vertices=61), asset(pinned=())
    world.reserve(world.assets[0], 3)
    world.reserve(world.assets[2], 3)
    world.reserve(world.assets[1], 1)
    world.build()
    return world


def pulled(world, stretch, kind=0):
    """A new bar, stretched along its axis and held at its ends."""
    for each in world.bodies:
        world.despawn(each)
    body = world.spawn(world.assets[kind])
    body.set_motion(BAR.vertices * [stretch, 1.0, 1.0], np.zeros_like(BAR.vertices))
    return body


def principal(body):
    """Return the largest principal stress of each tetrahedron [Pa], by the neo-Hookean law in closed form."""
    F = body.deformations()
    m, l = 4 / 3 * JELLY.lame_mu, JELLY.lame_lambda + 5 / 6 * JELLY.lame_mu  # noqa: E741
    J, square = np.linalg.det(F), np.einsum("mab,mab->m", F, F)
    stretch = np.linalg.svd(F, compute_uv=False)[:, 0]
    return m * (1 - 1 / (square + 1)) * stretch**2 / J + l * (J - 1) - JELLY.lame_mu


def run(world, steps):
    for _ in range(steps):
        world.step(DT, 24)


def test_below_its_strength_nothing_tears(world):
    body = pulled(world, 1.08)
    highest = 0.0
    for _ in range(60):
        run(world, 1)
        highest = max(highest, principal(body).max())
    assert 0.5 * STRENGTH < highest < STRENGTH
    assert body.topology_version == 0


def test_a_bar_tears_through_at_its_waist_and_nowhere_else(world):
    body = pulled(world, 1.2)
    masses = body.masses.sum()
    run(world, 240)
    parts = world.bodies
    assert len(parts) >= 2
    assert sum(part.masses.sum() for part in parts) == pytest.approx(masses, rel=1e-12)
    assert sum(len(part.tets) for part in parts) == len(BAR.tets)
    copies = np.concatenate([part.vertex_origins for part in parts])
    torn = np.flatnonzero(np.bincount(copies, minlength=len(BAR.vertices)) > 1)
    assert len(torn) >= 6
    assert (np.abs(BAR.vertices[torn, 0] - 0.625) < 0.3).all()
    held = [part for part in parts if len(part.pinned)]
    assert len(held) == 2  # one at each end
    for part in parts:
        assert principal(part).max() < STRENGTH
        x = part.positions()
        assert np.ptp(x[:, 0]) < 1.9


def test_a_bar_between_two_frames_tears_and_each_part_hangs_on_by_its_end(world):
    """After the tear, the frames no longer feel the pull, and each frame carries its part along."""
    body = pulled(world, 1.2, kind=2)
    right = BAR.vertices[:, 0] > 0
    frames = [world.add_frame(), world.add_frame((2, 0, 0))]
    holds = [
        body.attach(ENDS[right[ENDS] == side], frame, two_way=True)
        for side, frame in zip((False, True), frames, strict=True)
    ]
    data = world.snapshot()
    run(world, 1)
    pull = [hold.force[0] for hold in holds]
    assert pull[0] > 500.0
    assert pull[1] < -500.0
    run(world, 200)
    assert len(world.bodies) >= 2
    first, second = (hold.body for hold in holds)
    assert first is not second
    assert {body.index for body in (first, second)} <= {each.index for each in world.bodies}
    assert first.attachments == (holds[0],)
    assert second.attachments == (holds[1],)
    for hold, side in zip(holds, (False, True), strict=True):
        assert set(hold.body.vertex_origins[hold.particles]) == set(ENDS[right[ENDS] == side])
        assert len(hold.particles) == 9  # none of them was split
        assert principal(hold.body).max() < STRENGTH
    for part in world.bodies:
        part.set_linear_damping(4.0)
    run(world, 120)
    for hold, before in zip(holds, pull, strict=True):
        assert abs(hold.force[0]) < 0.02 * abs(before)
    where, names = second.positions(), world.state_hash()
    frames[1].teleport((2, 0, 3))
    np.testing.assert_allclose(second.positions(), where + np.array([0, 0, 3]), atol=1e-5)
    world.restore(data)
    assert holds[0].body is holds[1].body is body
    run(world, 201)
    for part in world.bodies:
        part.set_linear_damping(4.0)
    run(world, 120)
    assert world.state_hash() == names


def test_what_falls_off_stays_in_the_body_where_no_slot_is_free(world):
    body = pulled(world, 1.2, kind=1)
    run(world, 240)
    assert world.bodies == (body,)
    assert body.topology_version > 0
    across = body.positions()[body.tets][:, :, 0]
    middle = 0.5 * (across.min() + across.max())
    assert principal(body).max() < STRENGTH
    assert middle == pytest.approx(0.0, abs=0.01)


def test_tears_are_the_same_every_time(world):
    told = []
    for _ in range(2):
        pulled(world, 1.2)
        run(world, 40)
        told.append(b"".join(part.positions().tobytes() for part in world.bodies))
    assert told[0] == told[1]


@pytest.mark.parametrize("kind", [0, 1])  # kind 0 falls apart into bodies, kind 1 stays one body
def test_each_tear_is_told_of_in_its_step(world, kind):
    pulled(world, 1.2, kind)
    world.record_events([Torn])
    told = []
    for _ in range(30):
        before = {body: body.topology_version for body in world.bodies}
        run(world, 1)
        events = world.drain_events()
        told += events
        assert all((event.step, event.time) == (world.step_count - 1, world.time) for event in events)
        assert [event.body for event in events] == [
            body for body, version in before.items() if body.topology_version != version
        ]
        new = [body for body in world.bodies if body not in before]
        assert sorted((piece for event in events for piece in event.pieces), key=world.bodies.index) == new
        for event in events:
            masses = [piece.masses.sum() for piece in event.pieces]
            assert masses == sorted(masses, reverse=True)
    assert told
    assert any(event.pieces for event in told) == (kind == 0)
    world.record_events([])


def test_of_a_tear_that_is_undone_nothing_is_left(world):
    """Stress above the limit, in tetrahedra that are intact again, is also undone."""
    body = pulled(world, 1.2)
    world.record_events([Torn])
    body.watch_stress(0.5 * STRENGTH)
    start, told = world.snapshot(), []
    for undone in (0, 12, 9):
        world.restore(start)
        run(world, 12 - undone)
        data = world.snapshot()
        run(world, undone)
        world.restore(data)
        run(world, undone)
        told.append(
            [
                (event.step, type(event), event.body.index, [piece.index for piece in event.pieces])
                if isinstance(event, Torn)
                else (event.step, type(event), event.body.index, event.tetrahedra.tolist())
                for event in world.drain_events()
            ]
        )
    assert {kind for _, kind, _, _ in told[0]} == {Torn, StressExceeded}
    assert told[1:] == [told[0]] * 2
    world.record_events([])


def test_bad_options_are_refused():
    for stress in (0.0, -1.0, np.nan, None, "strong"):
        with pytest.raises(OptionError, match="stress must be"):
            Tearing(stress)
    with pytest.raises(OptionError, match="most must be"):
        Tearing(1.0, most=0)
    with pytest.raises(OptionError, match=r"Tearing.*None"):
        asset(tearing=3e4)
    with pytest.raises(OptionError, match="needs spare_vertices"):
        asset(spare_vertices=0)
    wood = AnisotropicMaterial(Stiffness.isotropic(1e5, 0.3), 1000.0)
    with pytest.raises(MaterialError, match=r"AnisotropicMaterial.*tearing"):
        SoftBodyAsset(BAR, wood, spare_vertices=5, tearing=Tearing(1.0))
