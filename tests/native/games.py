"""Games as lists of calls, one a line, that players in several languages play: here on a World of Python."""

import hashlib
import subprocess

import numpy as np

from taichi_soft import (
    BoxShape,
    Broke,
    CapsuleShape,
    ContactBegan,
    ContactEnded,
    Entered,
    FellAsleep,
    Froze,
    Left,
    PlaneShape,
    SphereShape,
    Woke,
)
from taichi_soft.bodies.status import DISABLED
from taichi_soft.contact.collider import row_of
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.grabs import Grabs
from taichi_soft.control.joints import Joints
from taichi_soft.control.motors import Motors
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.math.rotations import quaternion_of
from taichi_soft.core.types import JointKind
from taichi_soft.world.world import context_of_world

MASK = (1 << 64) - 1
KINDS = {
    ContactBegan: 1,
    ContactEnded: 2,
    FellAsleep: 4,
    Woke: 8,
    Froze: 16,
    Entered: 32,
    Left: 64,
    Broke: 128,
}


def hash_of(rows):
    """FNV-1a over words of 4 bytes, as `engine_adapter/native/tests/play.c` prints it."""
    code = 14695981039346656037
    for word in np.ascontiguousarray(rows, dtype=np.float32).reshape(-1).view(np.uint32).tolist():
        code = ((code ^ word) * 1099511628211) & MASK
    return f"{code:016x}"


def line(call, *arguments):
    """Return a call of a game as a line: numbers and tuples as they are, lists with their length first."""
    numbers = []
    for each in arguments:
        numbers += [len(each), *each] if isinstance(each, list) else np.ravel(each).tolist()
    return " ".join([call, *(repr(float(number)) for number in numbers)])


def lines_of(command, game, **options):
    """Return the output of a player without Python. `command` is the program and the folder of the world."""
    done = subprocess.run(
        [str(each) for each in command], input="\n".join(game), capture_output=True, text=True, **options
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def digests(lines, every=60):
    """Return hashes of a game's output up to some of its lines."""
    digest, found = hashlib.sha256(), []
    for number, each in enumerate(lines):
        digest.update(each.encode())
        if number % every == 0:
            found.append(digest.hexdigest()[:16])
    return [*found, digest.hexdigest()[:16]]


class Player:
    """Plays games on a world of Python, and records the output that other players print."""

    def __init__(self, world, meshes=()):
        """Args: meshes: of each mesh of the world file, a function (body) -> render mesh."""
        self.world, self.meshes, self.lines = world, meshes, []
        self.assets = list(dict.fromkeys(context_of_world(world).slots.assets))
        self.kept = b""

    def play(self, game):
        """Play a game; returns all that was printed."""
        for text in game:
            call, *rest = text.split()
            self.numbers = [float(each) for each in rest]
            getattr(self, call)()
        return self.lines

    def take(self, count):
        found, self.numbers = self.numbers[:count], self.numbers[count:]
        return found

    def whole(self):
        return int(self.take(1)[0])

    def list(self):
        return [int(each) for each in self.take(self.whole())] or None

    def body(self):
        return context_of_world(self.world).slots.slots[self.whole()]

    def collider(self):
        return context_of_world(self.world).colliders.all_handles[self.whole()]

    def say(self, text):
        self.lines.append(text)

    def step(self):
        dt, substeps = self.take(2)
        self.world.step(dt, int(substeps) or None)
        self.say(self.world.bodies_hash())

    def impulse(self):
        self.body().apply_impulse(self.take(3), self.list())

    def force(self):
        self.body().apply_force(self.take(3), self.list())

    def impulse_at(self):
        self.body().apply_impulse_at_point(self.take(3), self.take(3), *self.take(1))

    def radial_impulse(self):
        center, (impulse, radius) = self.take(3), self.take(2)
        self.world.apply_radial_impulse(center, impulse, radius)

    def velocity(self):
        self.body().set_velocity(self.take(3), self.take(3))

    def teleport(self):
        body, center, turn = self.body(), self.take(3), self.take(4)
        body.teleport(center, turn, keep_velocity=bool(self.whole()))

    def gravity_scale(self):
        self.body().set_gravity_scale(*self.take(1))

    def damping(self):
        self.body().set_linear_damping(*self.take(1))

    def sheltered(self):
        self.body().set_sheltered(bool(self.whole()))

    def pin(self):
        self.body().pin(self.list())

    def unpin(self):
        self.body().unpin(self.list())

    def targets(self):
        body, vertices = self.body(), self.list()
        body.set_targets(vertices, np.reshape(self.numbers, (-1, 3)))

    def set_level(self):
        body, level = self.body(), self.whole()
        body.set_level(level, release=bool(self.whole()))

    def level(self):
        body = self.body()
        self.say(f"{body.level} {body.vertex_count}")

    def wind(self):
        velocity, (density, drag) = self.take(3), self.take(2)
        self.world.set_wind(velocity, density=density, drag=drag)

    def gravity(self):
        self.world.set_gravity(self.take(3))

    def view_origin(self):
        self.world.set_view_origin(self.take(3))

    def shift_origin(self):
        self.world.shift_origin(self.take(3))

    def floor_friction(self):
        self.world.set_friction(*self.take(1))

    def body_friction(self):
        self.body().set_friction(*self.take(1))

    def collider_friction(self):
        self.collider().set_friction(*self.take(1))

    def enabled(self):
        self.body().set_enabled(bool(self.whole()))

    def body_filter(self):
        self.body().set_filter(self.whole(), self.whole())

    def collider_filter(self):
        self.collider().set_filter(self.whole(), self.whole())

    def surface_velocity(self):
        self.collider().set_surface_velocity(self.take(3))

    def wake(self):
        self.world.wake()

    def spawn(self):
        asset = self.assets[self.whole()]
        place = dict(
            position=self.take(3), rotation=self.take(4), velocity=self.take(3), angular_velocity=self.take(3)
        )
        self.world.spawn(asset, **place)

    def despawn(self):
        self.world.despawn(self.body())

    def say_hit(self, hit):
        if hit is None:
            self.say("nothing")
            return
        row = [hit.distance, *hit.barycentrics, *hit.point, *hit.normal]
        self.say(" ".join(map(str, [hit.body.index, *hit.vertices.tolist(), hash_of(row)])))

    def raycast(self):
        origin, direction, (reach,) = self.take(3), self.take(3), self.take(1)
        self.say_hit(self.world.raycast(origin, direction, max_distance=reach, cull_back=True))

    def closest(self):
        point, (reach,) = self.take(3), self.take(1)
        found = self.world.closest_point(point, max_distance=reach)
        self.say_hit(found)
        if found is not None:
            self.say(str(int(found.is_inside)))

    def targets_of(self, targets, mask):
        bodies = None if targets & 1 else []
        return dict(bodies=bodies, colliders=bool(targets & 2), mask=ALL_GROUPS if mask == -1 else mask)

    def say_touch(self, touch):
        if touch is None:
            self.say("nothing")
            return
        is_body = touch.collider is None
        weights = touch.barycentrics if is_body else np.zeros(3)
        row = [touch.distance, *weights, *touch.point, *touch.normal]
        names = [touch.body.index, -1, touch.vertices[0]] if is_body else [-1, touch.collider.index, -1]
        triangle = -1 if touch.triangle is None else touch.triangle
        is_inside, depth = getattr(touch, "is_inside", False), getattr(touch, "depth", 0.0)
        told = [*names, triangle, int(is_inside), f"{int(depth * 1e6):08x}", hash_of(row)]
        self.say(" ".join(map(str, told)))

    def cast(self):
        kind, size, position, rotation = self.whole(), self.take(3), self.take(3), self.take(4)
        direction, (reach,) = self.take(3), self.take(1)
        targets = self.targets_of(self.whole(), self.whole())
        if kind == 0:
            self.say_touch(self.world.raycast(position, direction, max_distance=reach, **targets))
            return
        shape = (None, lambda: SphereShape(size[0]), lambda: BoxShape(size), lambda: CapsuleShape(*size[:2]))[
            kind
        ]()
        given = dict(rotation=rotation, max_distance=reach, **targets)
        self.say_touch(self.world.shapecast(shape, position, direction, **given))

    def nearest(self):
        point, (reach,) = self.take(3), self.take(1)
        targets = self.targets_of(self.whole(), self.whole())
        self.say_touch(self.world.closest_point(point, max_distance=reach, **targets))

    def say_bodies(self, overlaps):
        self.say(" ".join(str(each.body.index) for each in overlaps) or "nothing")

    def overlap_sphere(self):
        self.say_bodies(self.world.overlap_sphere(self.take(3), *self.take(1)))

    def overlap_box(self):
        position, rotation, size = self.take(3), self.take(4), self.take(3)
        self.say_bodies(self.world.overlap_box(position, size, rotation=rotation))

    def record_events(self):
        bits = self.whole()
        self.world.record_events([kind for kind, bit in KINDS.items() if bits & bit])

    def drain(self):
        events = self.world.drain_events()
        self.say(f"events {len(events)}")
        for event in events:
            is_contact = isinstance(event, (ContactBegan, ContactEnded))
            body, other = (event.a, event.b) if is_contact else (event.body, getattr(event, "other", None))
            is_body = hasattr(other, "positions")
            row = [
                event.time,
                *getattr(event, "impulse", (0, 0, 0)),
                getattr(event, "duration", 0.0),
            ]
            touched = other if is_contact and not is_body else getattr(event, "sensor", None)
            collider = -1 if touched is None else touched.index
            if isinstance(other, Frame):
                collider = other._number
            who = [body.index, other.index if is_body else -1]
            self.say(" ".join(map(str, [KINDS[type(event)], collider, event.step, *who, hash_of(row)])))

    def frame(self):
        return context_of_world(self.world).of(Frames).rows[self.whole()]

    def attach(self):
        body, vertices = self.body(), self.list()
        body.attach(vertices, self.frame(), two_way=bool(self.whole()))

    def detach(self):
        body, vertices = self.body(), self.list()
        for held in body.attachments:
            if vertices is None or held.particles.tolist() == sorted(vertices):
                held.release()

    def load(self):
        body, frame = self.body(), self.frame()
        (held,) = [each for each in body.attachments if each.frame is frame]
        self.say(hash_of([*held.force, *held.torque]))

    def grab_of(self):
        return context_of_world(self.world).of(Grabs).by_number[self.whole()]

    def grab(self):
        body, triangle = self.body(), self.whole()
        weights, point, (frequency, most) = self.take(3), self.take(3), self.take(2)
        held = body.grab(triangle, weights, frequency=frequency, max_force=None if most < 0 else most)
        held.move(point)

    def move_grab(self):
        self.grab_of().move(self.take(3))

    def release_grab(self):
        self.grab_of().release()

    def grab_force(self):
        self.say(hash_of(self.grab_of().force))

    def join(self):
        body, vertices, other, onto = self.body(), self.list(), self.body(), self.list()
        self.say(str(body.attach_to(other, vertices, onto=onto)._number))

    def connect(self):
        body, other, kind = self.body(), self.body(), self.whole()
        anchor, axis = self.take(3), self.take(3)
        joint = self.world.connect(body, other, list(JointKind)[kind], anchor=anchor, axis=axis)
        self.say(str(joint._number))

    def joint(self):
        return context_of_world(self.world).of(Joints).by_number[self.whole()]

    def joint_force(self):
        self.say(hash_of(self.joint().force))

    def break_force(self):
        joint, (force,) = self.joint(), self.take(1)
        joint.set_break_force(force or None)

    def break_attachment(self):
        body, frame, (force,) = self.body(), self.frame(), self.take(1)
        for each in body.attachments:
            if each.frame is frame:
                each.set_break_force(force or None)

    def release_joint(self):
        self.joint().release()

    def add_motor(self):
        body, vertices = self.body(), self.list()
        turns, is_fixed, has_point = (bool(each) for each in self.take(3))
        axis, point, (speed, limit) = self.take(3), self.take(3), self.take(2)
        made = self.world.add_motor(
            body,
            vertices,
            axis,
            speed=speed,
            **{"max_torque" if turns else "max_force": limit},
            is_fixed=is_fixed,
            point=point if has_point else None,
        )
        self.say(str(made._number))

    def motor(self):
        return context_of_world(self.world).of(Motors).by_number[self.whole()]

    def motor_speed(self):
        self.motor().set_speed(*self.take(1))

    def motor_limit(self):
        self.motor().set_limit(*self.take(1))

    def motor_state(self):
        motor = self.motor()
        self.say(hash_of([motor.measured_speed, motor.effort]))

    def remove_motor(self):
        self.motor().remove()

    def add_frame(self):
        frame = self.world.add_frame(self.take(3), self.take(4))
        self.say(str(context_of_world(self.world).of(Frames).number_of(frame)))

    def remove_frame(self):
        self.frame().remove()

    def frame_pose(self):
        frame = self.frame()
        self.say(hash_of([*frame.position, *quaternion_of(frame.rotation.astype(float))]))

    def shape(self):
        kind, (x, y, z) = self.whole(), self.take(3)
        shapes = PlaneShape, lambda: SphereShape(x), lambda: BoxShape((x, y, z)), lambda: CapsuleShape(x, y)
        return shapes[kind]()

    def add_sensor(self):
        shape, (group, mask) = self.shape(), self.take(2)
        position, rotation = self.take(3), self.take(4)
        made = self.world.add_sensor(
            shape, position=position, rotation=rotation, group=int(group), mask=int(mask)
        )
        self.say(str(made.index))

    def bodies_inside(self):
        self.say(" ".join(str(each.index) for each in self.collider().bodies_inside) or "nothing")

    def add_collider(self):
        shape, (friction, restitution, thickness, group, mask) = self.shape(), self.take(5)
        made = self.world.add_collider(
            shape,
            friction=friction,
            restitution=None if restitution < 0 else restitution,
            thickness=thickness,
            group=int(group),
            mask=int(mask),
            position=self.take(3),
            rotation=self.take(4),
        )
        self.say(str(made.index))

    def remove_collider(self):
        self.collider().remove()

    def move_collider(self):
        self.collider().move_to(self.take(3), self.take(4))

    def drive_collider(self):
        self.collider().set_velocity(self.take(3), self.take(3))

    def teleport_collider(self):
        self.collider().teleport(self.take(3), self.take(4))

    def move_frame(self):
        self.frame().move_to(self.take(3), self.take(4))

    def snapshot(self):
        self.kept = self.world.snapshot()

    def restore(self):
        self.world.restore(self.kept)

    def positions(self):
        body, (alpha,) = self.body(), self.take(1)
        self.say(hash_of(self.world.read_positions(body, alpha)))

    def mesh(self):
        body, number = self.body(), self.whole()
        rows, normals = self.world.read_render_mesh(self.meshes[number](body), 1.0)
        self.say(f"{hash_of(rows)} {hash_of(normals)}")

    def collider_impulse(self):
        collider = self.collider()
        self.say(hash_of(np.concatenate([collider.impulse, collider.angular_impulse])))

    def collider_pose(self):
        row = row_of(self.collider())
        self.say(hash_of(np.concatenate([row.position, row.rotation])))

    def status(self):
        status = int(context_of_world(self.world).built.state.body_status[self.body().index])
        self.say(str(min(status, DISABLED)))

    def stable_substeps(self):
        self.say(str(self.world.stable_substeps(*self.take(1))))
