"""A world with objects of all kinds, and a game with random actions. A seed determines all actions.

Run the game by hand for any number of ticks and threads:

    python tests/shared/random_play.py --ticks 10000 --threads 2
"""

import argparse
import contextlib
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

# ruff: noqa: E402, E501
from taichi_soft import (
    Contact,
    HeightFieldShape,
    Material,
    OptionError,
    Plasticity,
    SoftBodyAsset,
    SphereShape,
    StateError,
    box,
    init,
)
from taichi_soft.world.bare import bare_world

DT, SUBSTEPS = 1 / 60, 10
SOFT = Material(young=3e4, poisson=0.3, density=500.0, damping=5.0)
FIRM = Material(young=6e4, poisson=0.2, density=700.0, damping=3.0)
WAVES = HeightFieldShape(np.sin(np.arange(42.0)).reshape(7, 6) / 50, 1.0)


def make_world(**options):
    """Make a world with two bodies and three colliders, and capacity for two more of each."""
    cube = SoftBodyAsset(
        box((0.4, 0.4, 0.4), cells=(2, 2, 2)),
        SOFT,
        contact=Contact(friction=0.4),
        plasticity=Plasticity(yield_strain=0.3, maximum=0.2),
        spare_vertices=12,
    )
    world = bare_world(soft_contact=True, sleep_speed=0.02, collider_room=2, sample_room=2000, **options)
    world.add_collider(SphereShape(0.3), position=(0, 0, 0.1))
    world.add_collider(WAVES)
    world.reserve(cube, 4)
    world.build()
    world.spawn(cube, position=(0.0, 0.0, 0.8))
    world.spawn(cube, position=(0.2, 0.1, 1.4))
    return world, cube


def _spawn(world, cube, rng):
    if len(world.bodies) < 4:
        place = rng.uniform((-1, -1, 1.5), (1, 1, 3))
        world.spawn(
            cube, position=place, velocity=rng.uniform(-2, 2, 3), angular_velocity=rng.uniform(-3, 3, 3)
        )


def _despawn(world, cube, rng):
    if len(world.bodies) > 1:
        world.despawn(world.bodies[rng.integers(len(world.bodies))])


def _body(world, rng):
    return world.bodies[rng.integers(len(world.bodies))]


def _some(body, rng, count):
    return rng.permutation(body.vertex_count)[:count]


def _push(world, cube, rng):
    body = _body(world, rng)
    body.apply_impulse(rng.uniform(-12, 12, 3), _some(body, rng, rng.integers(5, 14)))


def _force(world, cube, rng):
    _body(world, rng).apply_force(rng.uniform(-500, 500, 3))


def _explode(world, cube, rng):
    world.apply_radial_impulse(rng.uniform(-1, 1, 3), rng.uniform(0, 60), 2.0)


def _pin(world, cube, rng):
    body = _body(world, rng)
    if not body.is_held and not len(body.pinned):
        body.pin(_some(body, rng, 2))
        body.set_targets(body.pinned, body.positions()[body.pinned] + rng.uniform(-0.02, 0.02, 3))


def _unpin(world, cube, rng):
    body = _body(world, rng)
    if len(body.pinned) and not body.attachments:
        body.unpin()


def _grab(world, cube, rng):
    body = _body(world, rng)
    if len(world.grabs) < 3 and not body.is_held and not len(body.pinned):
        body.grab(rng.integers(len(body.surface)), max_force=400.0)


def _pick(world, cube, rng):
    if len(world.grabs) < 3:
        world.grab(rng.uniform((-1, -1, 3), (1, 1, 4)), (0, 0, -1), max_force=400.0)


def _cut(world, cube, rng):
    body = _body(world, rng)
    with contextlib.suppress(StateError):  # the body is grabbed, or there is no free slot for its parts
        body.cut(plane=(body.center_of_mass(), rng.normal(size=3)))


def _move_grabs(world, cube, rng):
    for grab in world.grabs:
        grab.move(rng.uniform((-1, -1, 0.5), (1, 1, 2)))


def _release(world, cube, rng):
    for grab in world.grabs[:1]:
        grab.release()


def _attach(world, cube, rng):
    body = _body(world, rng)
    if not body.is_held and not len(body.pinned) and len(world.frames) < 5:
        frame = world.add_frame(body.center_of_mass())
        body.attach(_some(body, rng, 3), frame, two_way=bool(rng.integers(2)))


def _move_frames(world, cube, rng):
    for frame in world.frames:
        frame.move_to(frame.position + rng.uniform(-0.03, 0.03, 3))


def _jump_frame(world, cube, rng):
    for frame in world.frames[:1]:
        if all(len({each.frame for each in body.attachments}) < 2 for body in world.bodies):
            frame.teleport(rng.uniform((-1, -1, 1), (1, 1, 2)), rng.permutation(np.eye(4))[0])


def _remove_frame(world, cube, rng):
    for frame in world.frames[:1]:
        frame.remove()


def _detach(world, cube, rng):
    for attachment in list(_body(world, rng).attachments):
        attachment.release()


def _join(world, cube, rng):
    if len(world.bodies) > 1 and len(world.joints) < 3:
        a, b = (world.bodies[i] for i in rng.permutation(len(world.bodies))[:2])
        count = min(3, a.vertex_count, b.vertex_count)
        a.attach_to(b, _some(a, rng, count), onto=_some(b, rng, count))


def _part(world, cube, rng):
    for joint in world.joints[:1]:
        joint.release()


def _drive(world, cube, rng):
    body = _body(world, rng)
    if len(world.motors) < 3 and body.vertex_count > 3:
        limit = {"max_torque": 20.0} if rng.integers(2) else {"max_force": 200.0}
        is_fixed = bool(rng.integers(2))
        axis, speed = rng.normal(size=3), rng.uniform(-5, 5)
        with contextlib.suppress(OptionError):  # the points lie on a line
            world.add_motor(body, _some(body, rng, 4), axis, speed=speed, is_fixed=is_fixed, **limit)


def _shift_gear(world, cube, rng):
    for motor in world.motors[:1]:
        motor.set_speed(rng.uniform(-5, 5))
        motor.set_limit(rng.uniform(0, 50))


def _brake(world, cube, rng):
    for motor in world.motors[:1]:
        motor.remove()


def _move_collider(world, cube, rng):
    world.colliders[0].move_to(world.colliders[0].position + rng.uniform(-0.05, 0.05, 3))


def _drive_collider(world, cube, rng):
    world.colliders[0].set_velocity(rng.uniform(-0.3, 0.3, 3), rng.uniform(-2, 2, 3))


def _add_collider(world, cube, rng):
    if len(world.colliders) < 5:
        world.add_collider(SphereShape(0.2), position=rng.uniform(-1, 1, 3), thickness=0.01)


def _add_ground(world, cube, rng):
    if len(world.colliders) < 5:
        world.add_collider(WAVES, position=(*rng.uniform(-1, 1, 2), -0.03))


def _remove_collider(world, cube, rng):
    if len(world.colliders) > 3:
        world.colliders[-1].remove()


def _blow(world, cube, rng):
    world.set_wind(rng.uniform(-5, 5, 3) if rng.integers(2) else None)


def _tilt(world, cube, rng):
    world.set_gravity((*rng.uniform(-2, 2, 2), rng.uniform(-12, -6)))


def _grease(world, cube, rng):
    surfaces = (world, *world.colliders, *world.bodies)  # for the world, the surface is that of the floor
    surfaces[rng.integers(len(surfaces))].set_friction(rng.uniform(0, 1))


def _remake(world, cube, rng):
    _body(world, rng).set_material(FIRM if rng.integers(2) else SOFT)


def _tune(world, cube, rng):
    body = _body(world, rng)
    body.set_gravity_scale(rng.uniform(0.5, 1.5))
    body.set_linear_damping(rng.uniform(0, 1))
    body.set_sheltered(bool(rng.integers(2)))
    body.set_damping(rng.uniform(3, 6))


def _throw(world, cube, rng):
    body = _body(world, rng)
    if not body.attachments:
        with contextlib.suppress(OptionError):  # a collider is there
            body.teleport(rng.uniform((-1, -1, 1), (1, 1, 2)))
        body.set_velocity(rng.uniform(-3, 3, 3), rng.uniform(-2, 2, 3))


ACTIONS = (
    _spawn, _despawn, _push, _force, _explode, _pin, _unpin, _grab, _move_grabs, _release, _attach, _move_frames,
    _detach, _move_collider, _drive_collider, _add_collider, _remove_collider, _blow, _remake, _tune, _throw,
    _join, _part, _pick, _cut, _jump_frame, _remove_frame, _add_ground,
    _drive, _shift_gear, _brake, _tilt, _grease,
)  # fmt: skip


def act(world, cube, seed, *, actions=ACTIONS, look=None):
    """Perform a player's random actions before the next step, often none.

    The step count and the seed determine the actions.

    Args: look: called after each action, with its name.
    """
    rng = np.random.default_rng([seed, world.step_count])
    for number in rng.integers(0, 2 * len(actions), 3).tolist():
        if number < len(actions):
            actions[number](world, cube, rng)
            if look is not None:
                look(actions[number].__name__)


def play(world, cube, ticks, seed):
    """Play a number of ticks, and return the hash of the state after each tick."""
    hashes = []
    for _ in range(ticks):
        act(world, cube, seed)
        world.step(DT, SUBSTEPS)
        hashes.append(world.state_hash())
    return hashes


def check(ticks, seed=0, chunk=20):
    """Compare a game with rollbacks with a straight run in a separate world.

    Each chunk is played with wrong inputs, undone, and played with the right inputs. Return the hashes of the
    straight run, and the number of hashes that differ.
    """
    world, cube = make_world()
    straight = play(world, cube, ticks, seed)
    del world  # the next world reuses its kernels
    other, cube = make_world()
    different = 0
    for begin in range(0, ticks, chunk):
        data = other.snapshot()
        play(other, cube, chunk, seed + 1)
        other.restore(data)
        again = play(other, cube, min(chunk, ticks - begin), seed)
        different += sum(a != b for a, b in zip(again, straight[begin:], strict=False))
    return straight, different


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--ticks", type=int, default=10_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    init("cpu", threads=chosen.threads)
    start = time.perf_counter()
    hashes, different = check(chosen.ticks, chosen.seed)
    print(
        f"{chosen.ticks} ticks, {chosen.threads} threads: {different} hashes differ after rollback; the last is "
        f"{hashes[-1]}; {time.perf_counter() - start:.0f} s"
    )
    sys.exit(different > 0)
