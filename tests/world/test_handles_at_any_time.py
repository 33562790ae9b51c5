"""Whatever a handle is asked, at any time of its life, it gives a value or a StateError."""

import contextlib
import gc

import numpy as np
import pytest
from random_play import ACTIONS, DT, SOFT, SUBSTEPS, WAVES, act
from reading import leave, misread

from engine_adapter import EngineAdapter, FixedStep, Rollback
from taichi_soft import (
    BoxShape,
    Contact,
    Event,
    MeshError,
    OptionError,
    Plasticity,
    SoftBodyAsset,
    SphereShape,
    SpringMaterial,
    StateError,
    box,
    rope,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

COARSE, FINE = box((0.4, 0.4, 0.4), cells=(1, 1, 1)), box((0.4, 0.4, 0.4), cells=(3, 3, 3))
SKIN = (COARSE.vertices, COARSE.surface)
LEAST_KEPT, MOST_KEPT = 12, 50


class Game:
    """A world with bodies of all kinds, and every handle that it has ever given out, up to a number."""

    def __init__(self):
        self.cube = SoftBodyAsset(
            box((0.4, 0.4, 0.4), cells=(2, 2, 2)),
            SOFT,
            contact=Contact(friction=0.4),
            plasticity=Plasticity(yield_strain=0.3, maximum=0.2),
            spare_vertices=12,
        )
        skinned = SoftBodyAsset(FINE, SOFT, skin=SKIN)
        self.crate = skinned.with_coarser(COARSE)
        self.rope = SoftBodyAsset(rope(1.0, 8, 0.5), SpringMaterial(2000.0, 2.0))
        world = self.world = bare_world(
            soft_contact=True, sleep_speed=0.02, collider_room=2, sample_room=2000
        )
        self.kept = [world]
        self.wrong = []
        self.kept += [world.add_collider(SphereShape(0.3), position=(0, 0, 0.1)), world.add_collider(WAVES)]
        self.kept += [world.add_frame(), world.add_body(COARSE, SOFT, position=(3, 3, 1))]
        self.look("before build")
        world.reserve(self.cube, 4)
        world.reserve(self.crate, 2)
        world.reserve(self.rope, 1)
        world.build()
        self.kept += [EngineAdapter(world, FixedStep(DT, SUBSTEPS), rewind_ticks=3, budget_ms=1e6)]
        self.kept += [Rollback(world, 3), world.on(Event, lambda event: None)]
        self.look("build")
        for x, asset in enumerate((self.cube, self.cube, self.crate, self.rope)):
            world.spawn(asset, position=(x, 0.0, 1.2))
            self.look("spawn")
        self.saved = world.snapshot()

    def look(self, name):
        """Read everything from all handles."""
        world = self.world
        found = [*world.bodies, *world.colliders, *world.frames, *world.grabs, *world.joints, *world.motors]
        for body in world.bodies:
            found += [*body.attachments, *body.render_meshes]
        with contextlib.suppress(MeshError, IndexError):
            found.append(world.bodies[world.step_count % 4].render_mesh())
        self.kept += [each for each in found if all(each is not other for other in self.kept)]
        self.kept = self.kept[:LEAST_KEPT] + self.kept[LEAST_KEPT:][-MOST_KEPT:]
        self.wrong += [f"after {name}: {told}" for each in self.kept for told in misread(each)]

    def save(self, world, cube, rng):
        self.saved = world.snapshot()

    def load(self, world, cube, rng):
        world.restore(self.saved)

    def load_and_add(self, world, cube, rng):
        world.restore(self.saved)
        with contextlib.suppress(StateError):  # there is no room
            self.kept.insert(LEAST_KEPT, world.add_collider(SphereShape(0.1), position=(0, 0, 5)))

    def change_level(self, world, cube, rng):
        for body in world.bodies:
            if body.asset is self.crate:
                with contextlib.suppress(StateError):  # it is frozen, or has another material
                    body.set_level(1 - body.level, release=True)

    def freeze(self, world, cube, rng):
        leave(world.bodies[rng.integers(len(world.bodies))])

    def thaw(self, world, cube, rng):
        for body in world.bodies:
            if body.is_frozen:
                body.set_motion(body.mesh.vertices + np.array([0, 0, 2]), 0 * body.mesh.vertices)


@pytest.mark.filterwarnings("ignore::taichi_soft.FrozenBodyWarning")
def test_every_readout_of_every_handle_gives_a_value_or_a_state_error():
    """Before and after `build`, and after each call of a random game: cut, removed, frozen, restored."""
    game = Game()
    more = (game.save, game.load, game.load_and_add, game.change_level, game.freeze, game.thaw)
    for _ in range(60):
        if game.world.bodies:
            with contextlib.suppress(OptionError, ValueError):  # a body has no room for a cut, or no surface
                act(game.world, game.cube, 11, actions=(*ACTIONS, *more), look=game.look)
        game.world.step(DT, SUBSTEPS)
        game.look("step")
        game.world.drain_events()
    kept, game.kept = game.kept, []
    del game.world
    gc.collect()
    gone = [told for each in kept[1:] for told in misread(each)]
    assert game.wrong + gone == []


def test_a_collider_that_was_added_has_felt_nothing_whoever_had_its_place():
    world = bare_world(collider_room=2)
    body = world.add_body(COARSE, SOFT, position=(0, 0, 0.5))
    world.build()
    data = world.snapshot()
    plate = world.add_collider(BoxShape((2, 2, 0.2)), position=(0, 0, 0.19))
    for _ in range(30):
        world.step(DT)
    pressed = plate.impulse[2]
    assert pressed == pytest.approx(-body.masses.sum() * 9.81 * DT, rel=0.5)
    plate.remove()
    other = world.add_collider(SphereShape(0.1), position=(5, 0, 0))
    assert other.index == plate.index
    assert not np.concatenate([other.impulse, other.angular_impulse]).any()
    world.restore(data)
    added = [world.add_collider(SphereShape(0.1), position=(5, i, 0)) for i in range(2)]
    assert not np.array([each.impulse for each in added]).any()


def test_a_level_of_detail_has_the_skin_of_the_finest():
    with pytest.raises(OptionError, match=r"level 1.*skin"):
        SoftBodyAsset(FINE, SOFT, skin=SKIN, coarser=(SoftBodyAsset(COARSE, SOFT),))
    both = SoftBodyAsset(FINE, SOFT, skin=SKIN, coarser=(SoftBodyAsset(COARSE, SOFT, skin=SKIN),))
    assert len(both.levels) == 2
