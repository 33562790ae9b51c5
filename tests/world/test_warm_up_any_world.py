"""`World.warm_up` takes any world that can be built, and leaves it as it is."""

import pytest
from reading import leave, misread

from taichi_soft import (
    Event,
    Material,
    ParticleMesh,
    Released,
    RodMaterial,
    ShellMaterial,
    SoftBodyAsset,
    SpringMaterial,
    TetMesh,
    box,
    cloth,
    rod,
    rope,
    sheet,
)
from taichi_soft.core.compilation import BURST
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

JELLY, SPRINGS = Material(3e4, 0.3, 800.0, 5.0), SpringMaterial(2000.0, 2.0)
STIFF, STIFF_SPRINGS = Material(6e4, 0.3, 800.0, 5.0), SpringMaterial(3000.0, 2.0)
CORNER = TetMesh([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]], [[0, 1, 2, 3]])
KINDS = {
    "rope": SoftBodyAsset(rope(1.0, 8, 0.5), SPRINGS),
    "pair": SoftBodyAsset(ParticleMesh([[0, 0, 0], [0.1, 0, 0]], [[0, 1]], 0.1), SPRINGS),
    "cloth": SoftBodyAsset(cloth((0.4, 0.4), (3, 3), mass=0.2), SPRINGS),
    "held rope": SoftBodyAsset(rope(1.0, 8, 0.5), SPRINGS, pinned=range(9)),
    "box": SoftBodyAsset(box((0.3, 0.3, 0.3), (2, 2, 2)), JELLY),
    "corner": SoftBodyAsset(CORNER, JELLY),
    "held box": SoftBodyAsset(box((0.3, 0.3, 0.3), (2, 2, 2)), JELLY, pinned=range(27)),
}
SPRING_KINDS, TET_KINDS = list(KINDS)[:4], list(KINDS)[4:]
SHELL, STIFF_SHELL = ShellMaterial(1e5, 0.3, 500.0, 1e-3), ShellMaterial(4e5, 0.3, 500.0, 1e-3)
SHELL_KINDS = {"shell": SoftBodyAsset(sheet((0.4, 0.4), (3, 3)), SHELL)}
ROD, STIFF_ROD = RodMaterial(1e6, 0.3, 1000.0, 0.02), RodMaterial(4e6, 0.3, 1000.0, 0.02)
ROD_KINDS = {"rod": SoftBodyAsset(rod(0.8, 8), ROD)}
CONTACT = {"soft_contact": True, "sleep_speed": 0.5}
WORLDS = {
    "contact": (list(KINDS), CONTACT),
    "contact, the other way round": (list(KINDS)[::-1], CONTACT),
    "contact, with a shell": (["box", *SHELL_KINDS], CONTACT),
    "contact, with a rod": (["box", *ROD_KINDS], CONTACT),
    "contact, ropes alone": (SPRING_KINDS, CONTACT),
    "implicit contact": (list(KINDS), {**CONTACT, "integrator": "implicit_euler"}),
    "plain": (list(KINDS), {}),
    "plain, ropes alone": (SPRING_KINDS, {}),
    "plain, tetrahedra alone": (TET_KINDS, {}),
    "flat": (list(KINDS), {"schedule": "flat"}),
    "implicit": (list(KINDS), {"integrator": "implicit_euler"}),
}


def nothing(world, bodies):
    pass


def pin(world, bodies):
    for body in bodies:
        body.pin(range(body.vertex_count))


def attach(world, bodies):
    frame = world.add_frame()
    for body in bodies:
        body.attach(range(body.vertex_count), frame)


def hold(world, bodies):
    """Attach and constrain bodies in all ways that the schedule allows."""
    for body in bodies:
        body.attach([0], world.add_frame(), two_way=True)
        if len(body.surface):
            body.grab(0)
    if len(world.colliders):
        world.add_motor(bodies[0], [1], (0, 0, 1), speed=1.0, max_force=1.0, is_fixed=True)


def freeze(world, bodies):
    for body in bodies:
        leave(body)
    world.step(1 / 60, 4)
    assert any(body.is_frozen for body in bodies)


def sleep(world, bodies):
    for _ in range(60):
        world.step(1 / 60, 30)
        for body in bodies:
            body.set_velocity((0, 0, 0))
    for _ in range(45):
        world.step(1 / 60, 30)
    assert any(body.is_asleep for body in bodies)


def remove(world, bodies):
    for body in bodies:
        world.despawn(body)


def remove_first(world, bodies):
    world.despawn(bodies[0])


def use(world):
    """Make steps, change materials, watch stress and read all there is to read."""
    for body in world.bodies:
        if len(body.tets):
            body.watch_stress(1e3)
            body.watch_tearing(1e3)
        body.set_motion(1.1 * body.positions(), body.velocities())
        stiff = STIFF_SHELL if body.asset in SHELL_KINDS.values() else STIFF_SPRINGS
        stiff = STIFF_ROD if body.asset in ROD_KINDS.values() else stiff
        body.set_material(STIFF if len(body.tets) else stiff)
    for _ in range(2):
        world.step(1 / 60, 40)
    assert [told for each in (world, *world.bodies, *world.colliders) for told in misread(each)] == []


@pytest.mark.filterwarnings(
    "ignore::taichi_soft.FrozenBodyWarning", "ignore::taichi_soft.UnstableStepWarning"
)
@pytest.mark.parametrize("name", WORLDS)
def test_warming_up_never_raises_and_changes_nothing(name, monkeypatch):
    """And nothing compiles where the game then steps, looks, watches stress and changes materials."""
    compiled, begin = [], BURST.begin
    monkeypatch.setattr(BURST, "begin", lambda kernel: compiled.append(kernel) or begin(kernel))
    kinds, options = WORLDS[name]
    world = bare_world(**options)
    for kind in kinds:
        world.reserve((KINDS | SHELL_KINDS | ROD_KINDS)[kind], 2)
    world.build()
    has_contact, is_flat = "soft_contact" in options, "schedule" in options
    states = [remove_first, pin, attach, freeze, remove]
    states += [] if is_flat else [hold]
    states += [sleep] if has_contact else []
    empty = world.snapshot()
    for state in (nothing, *states):
        world.restore(empty)
        bodies = [
            world.spawn((KINDS | SHELL_KINDS | ROD_KINDS)[kind], position=(2.0 * i, 0, 0.31))
            for i, kind in enumerate(kinds)
        ]
        state(world, bodies)
        before = world.snapshot(), world.state_hash(), world.bodies, world.step_count
        world.warm_up()
        assert (world.snapshot(), world.state_hash(), world.bodies, world.step_count) == before, state
        if state is not freeze:  # to find out what froze it compiles
            compiled.clear()
            use(world)
            assert compiled == [], state


def test_events_that_wait_are_kept():
    """The waiting event is that of a joint that a change of level released."""
    fine, coarse = (box((0.3, 0.3, 0.3), (n, n, n)) for n in (2, 1))
    crate = SoftBodyAsset(fine, JELLY, coarser=(SoftBodyAsset(coarse, JELLY),))
    world = bare_world(soft_contact=True)
    other = world.add_body(fine, JELLY, position=(0, 0, 1))
    world.reserve(crate, 1)
    world.build()
    body = world.spawn(crate, position=(2, 0, 1))
    joint = body.attach_to(other, [0], onto=[0])
    world.record_events([Event])
    body.set_level(1, release=True)
    world.warm_up()
    assert [event.handles for event in world.drain_events() if isinstance(event, Released)] == [(joint,)]
