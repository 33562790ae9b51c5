"""Table of the public API: valid and invalid arguments of each call, and reasons to refuse a call."""

# ruff: noqa: E501 (one line for each call)
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from engine_adapter import EngineAdapter, FixedStep, Rollback, RollbackSession
from taichi_soft import (
    AnisotropicMaterial,
    BoxShape,
    CapsuleShape,
    Contact,
    ContactBegan,
    Event,
    FellAsleep,
    HeightFieldShape,
    Material,
    MeshShape,
    PlaneShape,
    Plasticity,
    RenderMesh,
    SoftBodyAsset,
    SphereShape,
    SpringMaterial,
    Stiffness,
    Tearing,
    World,
    box,
    rope,
)
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.world.bare import bare_world

NAN, INF, HUGE = float("nan"), float("inf"), 10**400
DT, SUBSTEPS = 1 / 60, 8
SOFT, FIRM = Material(3e4, 0.3, 500.0, 5.0), Material(6e4, 0.2, 700.0, 3.0)
BLOCK = box((0.4, 0.4, 0.4), cells=(2, 2, 2))
N, M = len(BLOCK.vertices), len(BLOCK.tets)
TOP_FACE = np.flatnonzero(BLOCK.vertices[:, 2] > 0.19)


class Game:
    """A world with objects of all kinds, and valid, expired and foreign handles."""

    def __init__(self, folder, *, slots=6, warm=False):
        self.folder = folder
        self.cube = SoftBodyAsset(BLOCK, SOFT, contact=Contact(friction=0.4), spare_vertices=40)
        world = self.world = bare_world(
            soft_contact=True,
            sleep_speed=0.3,
            collider_room=4,
            sample_room=20,
            record=6,
            record_to=folder / "frozen.recording",
            retries=0,
        )
        world.add_collider(SphereShape(0.3), position=(0.0, 0.0, 0.1))
        world.add_collider(HeightFieldShape(np.zeros((4, 4)), 1.0), position=(0.0, 0.0, 0.02))
        world.reserve(self.cube, slots)
        world.build()
        if warm:
            world.warm_up()
        world.set_wind((0.3, 0.0, 0.0))
        self.sleeper = world.spawn(self.cube, position=(3.0, 3.0, 0.21))
        self._leave_dead_handles()
        for _ in range(90):
            world.step(DT, SUBSTEPS)
        self._fill()
        self._meet_another_world()
        self.base = world.snapshot()
        self.receiver: Any = None  # object whose method is called with the drawn arguments
        self.begin()

    def _leave_dead_handles(self):
        world = self.world
        body = self.dead_body = world.spawn(self.cube, position=(0.0, 0.0, 2.0))
        self.dead_frame = world.add_frame()
        self.dead_frame.remove()
        self.dead_grab, self.dead_hold = body.grab(0), body.attach([0], world.add_frame(), two_way=True)
        neighbour = world.spawn(self.cube, position=(0.5, 0.0, 2.0))
        self.dead_joint = body.attach_to(neighbour, [0], onto=[0])
        self.dead_mesh = body.render_mesh()
        self.dead_motor = world.add_motor(body, [0], (0, 0, 1), speed=1.0, max_force=1.0, is_fixed=True)
        self.dead_motor.remove()
        self.dead_grab.release()
        self.dead_hold.release()
        self.dead_joint.release()
        world.despawn(neighbour)
        self.dead_collider = world.add_collider(SphereShape(0.1), position=(9.0, 0.0, 0.0))
        self.dead_collider.remove()
        world.despawn(body)

    def _fill(self):
        world = self.world
        self.free = world.spawn(self.cube, position=(0.0, 0.0, 1.0))
        self.held = world.spawn(self.cube, position=(1.5, 0.0, 1.0))
        self.held.pin([26, 25])
        self.frame = world.add_frame(position=(1.5, 0.0, 1.0))
        self.hold = self.held.attach([0, 1], self.frame, two_way=True)
        self.hand = self.held.grab(3)
        self.hanging = world.spawn(self.cube, position=(1.9, 0.0, 1.0))
        self.joint = self.hanging.attach_to(self.held, np.flatnonzero(BLOCK.vertices[:, 0] < -0.19))
        self.motor = world.add_motor(self.hanging, TOP_FACE, (0, 0, 1), speed=2.0, max_torque=3.0)
        self.collider = world.colliders[0]
        for _ in range(5):
            world.step(DT, SUBSTEPS)
        self.free.apply_force((5.0, 0.0, 0.0))
        assert self.sleeper.is_asleep

    def _meet_another_world(self):
        self.other = bare_world(retries=0)
        self.foreign_body = self.other.add_body(BLOCK, SOFT, position=(0.0, 0.0, 2.0))
        self.foreign_frame = self.other.add_frame()
        self.foreign_mesh = self.foreign_body.render_mesh()
        self.foreign_asset = SoftBodyAsset(BLOCK, SOFT)

    def begin(self):
        """Restore the initial state, including the parts that no snapshot contains."""
        world = self.world
        world.restore(self.base)
        world.set_force_field(None)
        world.record_events([Event])
        world.drain_events()
        self.listener = world.on(Event, print_nothing)
        self.listener.remove()
        self.adapter = EngineAdapter(world, FixedStep(DT, SUBSTEPS), rewind_ticks=3, budget_ms=1e6)
        self.rollback = Rollback(world, 3)
        self.rollback.save()

    @property
    def grabs(self):
        return self.world.grabs

    @property
    def holds(self):
        return [each for body in self.world.bodies for each in body.attachments]

    @property
    def joints(self):
        return self.world.joints

    @property
    def frames(self):
        return self.world.frames

    def handles(self, kind):
        """Return the valid handles of a class."""
        single = {"World": self.world, "EngineAdapter": self.adapter, "Rollback": self.rollback}
        if kind in single:
            return [single[kind]]
        lists = {"Body": self.world.bodies, "Collider": self.world.colliders, "Frame": self.frames}
        lists |= {
            "Grab": self.grabs,
            "Attachment": self.holds,
            "Joint": self.joints,
            "Motor": self.world.motors,
            "Listener": [self.listener],
        }
        return list(lists[kind])


def print_nothing(_):
    pass


class NothingThereError(Exception):
    """The game has no object of the kind that an argument needs."""


def one_of(values, rng):
    if not len(values):
        raise NothingThereError
    return values[rng.integers(len(values))]


class Kind(NamedTuple):
    """Valid and invalid values of one argument."""

    sound: Callable[[Game, np.random.Generator], Any]
    bad: dict[str, Any]

    def but(self, *names, **more):
        """Return a copy with other invalid values: without the named values, and with additional values."""
        left = {name: value for name, value in self.bad.items() if name not in names}
        return Kind(self.sound, left | more)

    def drawn(self, sound):
        return Kind(sound, self.bad)


class Of(NamedTuple):
    """An invalid value that is taken from the game."""

    find: Callable[[Game], Any]


NOT_NUMBERS = {
    "nan": NAN, "inf": INF, "-inf": -INF, "text": "1", "none": None, "flag": True, "list": [1.0],
    "complex": 1j, "beyond any float": HUGE, "beyond any float, below zero": -HUGE, "object": object(),
    "array": np.array([1.0, 2.0]), "nan of numpy": np.float32("nan"), "class": float,
}  # fmt: skip
NOT_COUNTS = NOT_NUMBERS | {"half": 1.5, "whole but float": 2.0, "below": -1, "far beyond": 2**70}
NOT_ROWS = {
    "none": None, "number": 1.0, "text": "up", "words": ("a", "b", "c"), "object": object(), "empty": (),
    "set": {1, 2, 3}, "dict": {0: 1.0}, "ragged": [1.0, [2.0, 3.0], 4.0], "objects": [object()] * 3,
    "complex": (1j, 0.0, 0.0), "flags": (True, False, True), "beyond any float": (HUGE, 0, 0),
    "nothings": (None, None, None), "class": tuple,
}  # fmt: skip
NOT_VECTORS = NOT_ROWS | {
    "nan": (0.0, NAN, 0.0), "inf": (INF, 0.0, 0.0), "two": (1.0, 2.0), "four": (1.0, 2.0, 3.0, 4.0),
    "row": [[1.0, 2.0, 3.0]], "huge": (0.0, 1e300, 0.0), "nan of numpy": np.full(3, np.float32("nan")),
}  # fmt: skip


def number(low, high, /, **more):
    return Kind(lambda game, rng: rng.uniform(low, high), NOT_NUMBERS | more)


def vector(low, high, /, **more):
    """Return the kind of a vector: tuples, lists and arrays, sometimes a thousand times as long."""

    def draw(game, rng):
        values = rng.uniform(low, high, 3) * (1000.0 if rng.integers(12) == 0 else 1.0)
        return [tuple(values.tolist()), values.tolist(), values, values.astype(np.float32)][rng.integers(4)]

    return Kind(draw, NOT_VECTORS | more)


def choice(*values, **bad):
    return Kind(lambda game, rng: values[rng.integers(len(values))], bad)


def or_none(kind):
    """Return a kind that also accepts None."""
    return Kind(
        lambda game, rng: None if rng.integers(3) == 0 else kind.sound(game, rng), kind.but("none").bad
    )


def _turn(game, rng):
    x = rng.normal(size=4)
    q = x / np.linalg.norm(x)
    if rng.integers(2):
        return q
    turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turned * np.sign(np.linalg.det(turned))


def _some(game, rng):
    return rng.permutation(game.receiver.vertex_count)[: rng.integers(1, 6)].tolist()


def _few(game, rng):
    """Choose a few indices that are valid for every body."""
    return rng.permutation(4)[: rng.integers(1, 5)].tolist()


PLACE = vector((-2.0, -2.0, 1.2), (2.0, 2.0, 3.0), far=(1e7, 0.0, 0.0), **{
    "below the floor": (0.0, 0.0, -3.0), "just too far": (9999999.99, 0.0, 3.0),
})  # fmt: skip
POINT = vector(-2.0, 2.0, far=(0.0, 0.0, -1e7))
SPEED = vector(-3.0, 3.0, fast=(0.0, 2e4, 0.0))
BELT = vector(-1.0, 1.0, fast=(0.0, 2e4, 0.0))
SPIN = vector(-5.0, 5.0, fast=(1e7, 0.0, 0.0), **{"too fast for the body": (0.0, 9e5, 0.0)})
PUSH = vector(-40.0, 40.0, strong=(0.0, 0.0, 1e21), **{"too strong for the body": (0.0, 1e13, 0.0)})
ROTATION = or_none(
    Kind(_turn, NOT_ROWS | {
        "long quaternion": (0.0, 0.0, 0.0, 2.0), "quaternion of zeros": (0.0, 0.0, 0.0, 0.0),
        "nan in a quaternion": (0.0, NAN, 0.0, 1.0), "mirror": np.diag([1.0, 1.0, -1.0]), "scale": 2 * np.eye(3),
        "zeros": np.zeros((3, 3)), "nan in a matrix": np.full((3, 3), NAN), "three": (0.0, 0.0, 1.0),
        "shear": [[1, 1, 0], [0, 1, 0], [0, 0, 1]], "huge": 1e300 * np.eye(3), "many": np.eye(3)[None],
    })
)  # fmt: skip
NOT_VERTICES = NOT_ROWS | {
    "below zero": [-1], "beyond": [0, 10**6], "far beyond": [2**70], "halves": [0.5], "floats": [1.0],
    "rows": [[0, 1]], "one number": 3, "nan": [NAN], "mask": np.ones(N, dtype=bool), "words": ["0"],
}  # fmt: skip
VERTICES = Kind(_some, NOT_VERTICES)
NOT_BODIES = {
    "none": None, "number": 0, "text": "body", "class": World, "removed": Of(lambda g: g.dead_body),
    "of another world": Of(lambda g: g.foreign_body), "collider": Of(lambda g: g.collider),
}  # fmt: skip
BODY = Kind(lambda game, rng: one_of(game.world.bodies, rng), NOT_BODIES)
SOME_BODIES = Kind(
    lambda game, rng: list(game.world.bodies)[: rng.integers(0, 3)],
    {"number": 1, "numbers": [0, 1], "one body": Of(lambda g: g.free), "removed": Of(lambda g: [g.dead_body]),
     "of another world": Of(lambda g: [g.free, g.foreign_body]), "nothings": [None]},
)  # fmt: skip
BODIES = or_none(SOME_BODIES)
FLAG = choice(True, False, none=None, number=1, text="yes", array=np.array([True, False]), nan=NAN)
BUFFER = Kind(
    lambda game, rng: None,
    {"list": [[0.0] * 3] * N, "double": np.zeros((N, 3)), "short": np.zeros((N - 1, 3), np.float32),
     "flat": np.zeros(3 * N, np.float32), "number": 0, "text": "out"},
)  # fmt: skip
DRAWN = Kind(
    lambda game, rng: one_of(game.world.bodies, rng).render_mesh(),
    {"none": None, "number": 0, "text": "skin", "body": Of(lambda g: g.free), "of a removed body": Of(lambda g: g.dead_mesh),
     "of another world": Of(lambda g: g.foreign_mesh), "class": RenderMesh},
)  # fmt: skip
DRAWN_BUFFER = BUFFER.but("short", "double", short=np.zeros((1, 3), np.float32), double=np.zeros((1, 3)))
GROUP = choice(1, 2, 3, **NOT_COUNTS, **{"too many bits": 2**40})
SHAPE = choice(
    SphereShape(0.2), BoxShape((0.3, 0.3, 0.2)), CapsuleShape(0.1, 0.3), PlaneShape(),
    HeightFieldShape(np.full((3, 3), 0.1), 0.5),
    none=None, text="sphere", **{"class": SphereShape, "mesh": BLOCK, "number": 1.0},
)  # fmt: skip
BREAK_FORCE = or_none(number(1e3, 1e6, zero=0.0, below=-1.0, strong=1e21))
NEVER = choice(None, **BREAK_FORCE.bad)
CAST_SHAPE = choice(
    SphereShape(0.2), BoxShape((0.3, 0.3, 0.2)), CapsuleShape(0.1, 0.3),
    none=None, text="sphere", plane=PlaneShape(), **{"class": SphereShape, "mesh": BLOCK, "number": 1.0},
)  # fmt: skip
COLLIDERS = choice(
    True, False, none=None, number=1, text="floor", **{
        "one collider": Of(lambda g: g.collider), "removed": Of(lambda g: [g.dead_collider]),
        "body": Of(lambda g: [g.free]), "numbers": [0],
    }
)  # fmt: skip
MASK = choice(1, 3, ALL_GROUPS, **NOT_COUNTS, **{"too many bits": 2**40})
MATERIAL = choice(
    SOFT, FIRM, none=None, text="rubber", number=1e5, **{
        "class": Material, "of springs": SpringMaterial(500.0, 0.2),
        "of another length": Material(np.full(M + 1, 1e4), 0.2, 500.0),
        "of another kind": AnisotropicMaterial(Stiffness.isotropic(1e4, 0.3), 500.0),
    }
)  # fmt: skip
ASSET = Kind(
    lambda game, rng: game.cube,
    {"none": None, "text": "cube", "mesh": BLOCK, "class": SoftBodyAsset, "without a pool": Of(lambda g: g.foreign_asset),
     "body": Of(lambda g: g.free)},
)  # fmt: skip
FRAME = Kind(
    lambda game, rng: one_of(game.frames, rng),
    {"none": None, "number": 0, "text": "hand", "removed": Of(lambda g: g.dead_frame),
     "of another world": Of(lambda g: g.foreign_frame), "body": Of(lambda g: g.free)},
)  # fmt: skip
STEP_LENGTH = number(1 / 240, 1 / 40, zero=0.0, short=1e-10, long=1e5, below=-DT)
SUBSTEP_COUNT = or_none(choice(6, 8, 12, **NOT_COUNTS, zero=0))
REACH = Kind(
    lambda game, rng: INF if rng.integers(2) else rng.uniform(0.5, 9.0),
    NOT_NUMBERS | {"zero": 0.0, "below": -1.0},
).but("inf")
RAY = vector((-1.0, -1.0, 2.0), (1.0, 1.0, 4.0), far=(1e7, 0.0, 0.0))
WAY = vector((-0.2, -0.2, -1.0), (0.2, 0.2, -0.5), zero=(0.0, 0.0, 0.0)).but("huge")
RAYS = Kind(lambda game, rng: rng.uniform(-1, 1, (5, 3)) + np.array([0, 0, 3]), NOT_ROWS | {
    "one": (0.0, 0.0, 1.0), "nan": np.full((5, 3), NAN), "far": np.full((5, 3), 1e7), "other": np.zeros((5, 2)),
})  # fmt: skip
WAYS = Kind(lambda game, rng: rng.uniform(-1, -0.5, (5, 3)), NOT_ROWS | {
    "one": (0.0, 0.0, 1.0), "nan": np.full((5, 3), NAN), "fewer": np.ones((4, 3)), "one of zeros": np.eye(5)[:, :3],
})  # fmt: skip
SIZE = vector(0.2, 1.0, zero=(0.0, 1.0, 1.0), below=(1.0, -1.0, 1.0), far=(1e7, 1.0, 1.0))
FREQUENCY = number(1.0, 8.0, zero=0.0, below=-1.0, high=1e4)
LOAD = or_none(number(10.0, 400.0, below=-1.0, strong=1e21))
THRESHOLD = or_none(number(1e2, 1e5, zero=0.0, below=-1.0)).but("inf", "-inf", inf=INF)
WEIGHTS = choice((1 / 3, 1 / 3, 1 / 3), (1.0, 0.0, 0.0), [0.2, 0.3, 0.5], **NOT_VECTORS, **{
    "below zero": (-1.0, 1.0, 1.0), "sum": (1.0, 1.0, 1.0), "zeros": (0.0, 0.0, 0.0)
})  # fmt: skip
SCALE = number(0.5, 1.5)
FRICTION = number(0.0, 1.0, below=-0.1, above=1e7)
EVENTS = choice([Event], [ContactBegan], (), [FellAsleep, ContactBegan], none=None, number=1, one=Event, **{
    "other classes": [int], "words": ["ContactBegan"], "nothings": [None], "instances": [object()],
})  # fmt: skip
EVENT = choice(Event, ContactBegan, none=None, text="ContactBegan", other=int, instance=object())
FUNCTION = choice(print_nothing, none=None, number=1, text="print")
FIELD = choice(None, lambda x, t: 0.1 * x, number=1, text="wind", rows=np.zeros((N, 3)))
ROWS = {
    "fewer": np.zeros((N - 1, 3)), "flat": np.zeros(3 * N), "nan": np.full((N, 3), NAN), "two": np.zeros((N, 2)),
    "far": np.full((N, 3), 1e8), "words": [["a", "b", "c"]] * N,
}  # fmt: skip
DATA = Kind(lambda game, rng: game.base, {
    "none": None, "text": "snapshot", "empty": b"", "number": 1, "other bytes": b"TSOFTSNP" * 99,
    "cut off": Of(lambda g: g.base[:-5]), "flipped": Of(lambda g: g.base[:-50] + b"\xff" + g.base[-49:]),
    "list": Of(lambda g: list(g.base[:99])),
})  # fmt: skip
PATH = Kind(lambda game, rng: game.folder / "game.recording", {
    "none": None, "number": 3, "empty": "", "nul": "a\0b", "folder": Of(lambda g: g.folder), "list": ["a"],
})  # fmt: skip


def _pinned(game, rng):
    return [25, 26]


class Call(NamedTuple):
    """A call's arguments by name, and True if it is refused despite valid arguments (None: unknown)."""

    takes: dict[str, Kind]
    refused: Callable[[Game, Any, dict[str, Any]], bool | None] = lambda game, handle, given: False


def always(game, handle, given):
    return True


def perhaps(game, handle, given):
    return None


def _is_wild(body):
    """True for a frozen body, or one so stretched or fast that valid arguments may move it out of range."""
    low, high = body.aabb()
    return body.is_frozen or (high - low).max() > 1.5 or np.abs(body.velocities()).max() > 50


def if_wild(game, body, given):
    return None if _is_wild(body) else False


def if_strong(game, body, given):
    return None if np.abs(given["impulse"]).max() > 100.0 else False


def if_wild_or_far(game, body, given):
    return None if _is_wild(body) or np.abs(given["point"]).max() > 10.0 else if_strong(game, body, given)


def _touches_attached(game, body, given):
    held = {p for each in body.attachments for p in each.particles.tolist()}
    return bool(held & set(given["particles"])) if given.get("particles") is not None else False


def _has_no_pins(game, body, given):
    return not set(given["particles"]) <= set(body.pinned.tolist()) or _touches_attached(game, body, given)


def _drives_too_much(game, world, given):
    """True if a motor with these arguments is refused, None if it may be refused.

    It is refused if both or no limits are given, or if a point is given without a torque about a fixed axis.
    It may be refused for too few vertices or too many motors.
    """
    turns, pushes = given["max_torque"] is not None, given["max_force"] is not None
    if turns == pushes or (given["point"] is not None and not (turns and given["is_fixed"])):
        return True
    return None if len(given["particles"]) < 3 or len(world.motors) >= 60 else False


def _has_full_hands(game, handle, given):
    return len(game.world.grabs) == 16


def _is_sound_grab(game, world, given):
    ray = {
        name: given[name] for name in ("origin", "direction", "max_distance", "bodies", "colliders", "mask")
    }
    hit = world.raycast(**ray)
    return len(world.grabs) == 16 and hit is not None and hit.body is not None


def _is_full(game, world, given):
    return len(world.bodies) == world.slot_count


def _has_no_room(game, world, given):
    return None if len(world._context.colliders.all_handles) >= 8 else False


def _is_not_kept(game, adapter, given):
    return None


def _cannot_turn(game, body, given):
    return bool(body.attachments) or if_wild(game, body, given)


def _hangs_elsewhere(game, frame, given):
    bodies = [each for each in game.world.bodies if any(hold.frame is frame for hold in each.attachments)]
    if any(hold.frame is not frame for each in bodies for hold in each.attachments):
        return True
    return None if any(_is_wild(each) for each in bodies) else False


NOTHING = Call({})
CALLS: dict[str, dict[str, Call]] = {
    "World": {
        "add_body": Call({
            "mesh": choice(BLOCK), "material": choice(SOFT), "law": choice("virial"), "strain": choice(None),
            "flips": choice(None), "damping_model": choice("edge"), "position": PLACE, "rotation": ROTATION,
            "velocity": SPEED, "on_floor": FLAG, "pinned": choice(()), "contact": choice(Contact()), "plasticity": choice(None),
            "spare_vertices": choice(0), "tearing": choice(None), "overlap": choice("part"),
        }, always),
        "add_rigid": Call({
            "surface": choice(BLOCK), "mass": choice(1.0), "density": choice(None), "position": PLACE, "rotation": ROTATION,
            "velocity": SPEED, "angular_velocity": SPIN, "on_floor": FLAG, "contact": choice(Contact()), "overlap": choice("part"),
        }, always),
        "connect": Call({
            "body": BODY.but("removed", "of another world"), "other": BODY, "kind": choice("ball"), "anchor": POINT,
            "axis": WAY, "break_force": choice(None),
        }, always),
        "reserve": Call({"asset": ASSET, "count": choice(1)}, always),
        "build": Call({}, always),
        "spawn": Call({"asset": ASSET, "position": PLACE, "rotation": ROTATION, "velocity": SPEED, "angular_velocity": SPIN, "on_floor": FLAG, "overlap": choice("part")}, _is_full),
        "despawn": Call({"body": BODY}),
        "add_collider": Call({
            "shape": SHAPE, "position": POINT, "rotation": ROTATION, "friction": number(0.0, 1.0, below=-0.1),
            "restitution": or_none(number(0.0, 1.0, below=-0.1, above=1.1)), "thickness": number(0.0, 0.02, below=-1.0),
            "group": GROUP, "mask": GROUP, "surface_velocity": BELT,
        }, _has_no_room),
        "add_sensor": Call({"shape": SHAPE, "position": POINT, "rotation": ROTATION, "group": GROUP, "mask": GROUP}, _has_no_room),
        "skip_step": Call({"bodies": SOME_BODIES}),
        "stable_step": Call({"body": BODY.but("removed", "of another world")}),
        "stable_substeps": Call({"dt": STEP_LENGTH}),
        "step": Call({"dt": STEP_LENGTH, "substeps": choice(6, 8, 12, **NOT_COUNTS, zero=0).but("none")}),
        "wake": NOTHING,
        "warm_up": NOTHING,
        "add_frame": Call({"position": POINT, "rotation": ROTATION}),
        "grab": Call({"origin": RAY, "direction": WAY, "max_distance": REACH, "bodies": BODIES, "colliders": COLLIDERS, "mask": MASK, "frequency": FREQUENCY, "max_force": LOAD}, _is_sound_grab),
        "add_motor": Call({
            "body": BODY, "particles": Kind(_few, NOT_VERTICES), "axis": vector(0.1, 1.0, zero=(0.0, 0.0, 0.0)),
            "speed": number(-5.0, 5.0, fast=1e5), "max_torque": or_none(number(0.0, 9.0, below=-1.0, strong=1e13)),
            "max_force": or_none(number(0.0, 90.0, below=-1.0, strong=1e13)), "is_fixed": FLAG, "point": or_none(POINT),
        }, _drives_too_much),
        "apply_radial_impulse": Call({"center": POINT, "impulse": number(-20.0, 60.0, strong=1e21, **{"too strong for a body": 1e13}), "radius": number(0.5, 3.0, zero=0.0, below=-1.0)}),
        "shift_origin": Call({"offset": POINT.but("far", far=(2e7, 0.0, 0.0))}),
        "set_view_origin": Call({"point": POINT.but("far", far=(2e7, 0.0, 0.0))}),
        "set_gravity": Call({"gravity": vector(-9.0, 9.0, far=(0.0, 0.0, -1e39))}),
        "set_friction": Call({"friction": FRICTION}),
        "set_wind": Call({"velocity": or_none(SPEED), "density": number(0.5, 2.0, below=-1.0), "drag": number(0.1, 2.0, below=-1.0)}),
        "set_force_field": Call({"function": FIELD}),
        "read_positions": Call({"body": BODY, "alpha": number(0.0, 1.0, below=-0.1, above=1.1), "out": BUFFER}),
        "read_render_mesh": Call({
            "mesh": DRAWN, "alpha": number(0.0, 1.0, below=-0.1, above=1.1), "positions": DRAWN_BUFFER, "normals": DRAWN_BUFFER,
        }),
        "record_events": Call({"kinds": EVENTS}),
        "on": Call({"kind": EVENT, "function": FUNCTION}),
        "drain_events": NOTHING,
        "raycast": Call({"origin": RAY, "direction": WAY, "max_distance": REACH, "bodies": BODIES, "colliders": COLLIDERS, "mask": MASK, "cull_back": FLAG}),
        "raycasts": Call({"origins": RAYS, "directions": WAYS, "max_distance": REACH, "bodies": BODIES, "colliders": COLLIDERS, "mask": MASK, "cull_back": FLAG}),
        "shapecast": Call({
            "shape": CAST_SHAPE, "position": POINT, "direction": WAY, "rotation": ROTATION, "max_distance": REACH,
            "bodies": BODIES, "colliders": COLLIDERS, "mask": MASK,
        }),
        "closest_point": Call({"point": POINT, "max_distance": REACH, "bodies": BODIES, "colliders": COLLIDERS, "mask": MASK}),
        "overlap_sphere": Call({"center": POINT, "radius": number(0.1, 2.0, zero=0.0, below=-1.0), "bodies": BODIES, "mask": MASK}),
        "overlap_box": Call({"center": POINT, "size": SIZE, "rotation": ROTATION, "bodies": BODIES, "mask": MASK}),
        "snapshot": NOTHING,
        "restore": Call({"data": DATA}),
        "state_hash": NOTHING,
        "bodies_hash": NOTHING,
        "save_recording": Call({"path": PATH}),
    },
    "Body": {
        "positions": Call({"out": BUFFER}),
        "set_motion": Call({
            "positions": Kind(lambda g, rng: rng.uniform(0.5, 1.0) * g.receiver.mesh.vertices + rng.uniform(1, 2, 3), NOT_ROWS | ROWS),
            "velocities": Kind(lambda g, rng: rng.uniform(-2, 2, (g.receiver.vertex_count, 3)), NOT_ROWS | ROWS),
        }),
        "apply_force": Call({"force": PUSH, "particles": or_none(VERTICES)}),
        "set_enabled": Call({"is_enabled": FLAG}),
        "set_filter": Call({"group": GROUP, "mask": GROUP}),
        "set_gravity_scale": Call({"scale": SCALE}),
        "set_friction": Call({"friction": FRICTION}),
        "set_linear_damping": Call({"rate": number(0.0, 2.0, below=-1.0)}),
        "set_sheltered": Call({"is_sheltered": FLAG}),
        "apply_impulse": Call({"impulse": PUSH, "particles": or_none(VERTICES)}, if_strong),
        "apply_impulse_at_point": Call({
            "impulse": PUSH, "point": POINT, "radius": number(20.0, 30.0, zero=0.0, below=-1.0, short=1e-6),
        }, if_wild_or_far),
        "set_velocity": Call({"linear": SPEED, "angular": SPIN}, if_wild),
        "teleport": Call({"position": PLACE, "rotation": ROTATION, "keep_velocity": FLAG}, _cannot_turn),
        "pin": Call({"particles": VERTICES}, _touches_attached),
        "unpin": Call({"particles": or_none(VERTICES)}, _touches_attached),
        "set_targets": Call({
            "particles": VERTICES.drawn(_pinned),
            "positions": Kind(lambda g, rng: rng.uniform(1.0, 1.3, (2, 3)), NOT_ROWS | {
                "fewer": np.ones((1, 3)), "nan": np.full((2, 3), NAN), "far": np.full((2, 3), 1e8),
            }),
        }, _has_no_pins),
        "attach": Call({"particles": VERTICES, "frame": FRAME, "two_way": FLAG, "break_force": NEVER}, _touches_attached),
        "attach_to": Call({
            "other": BODY, "particles": choice([0, 3], **VERTICES.bad), "onto": choice([1, 2], **VERTICES.but("none").bad), "break_force": BREAK_FORCE,
        }, perhaps),
        "grab": Call({
            "triangle": Kind(lambda g, rng: int(rng.integers(len(g.receiver.surface))), NOT_COUNTS | {"beyond": 10**5}), "barycentrics": WEIGHTS, "frequency": FREQUENCY,
            "max_force": LOAD,
        }, _has_full_hands),
        "set_material": Call({"material": MATERIAL}),
        "set_level": Call({"level": choice(0, **NOT_COUNTS, finer=1), "release": FLAG}, perhaps),
        "set_damping": Call({"damping": Kind(
            lambda g, rng: rng.uniform(1.0, 9.0) if rng.integers(2) else rng.uniform(1.0, 9.0, len(g.receiver.tets)),
            NOT_NUMBERS | {"below": -1.0, "of another length": np.ones(M + 1), "nan in one": np.full(M, NAN)},
        )}),
        "cut": Call({
            "plane": Kind(
                lambda g, rng: (g.receiver.center_of_mass(), rng.normal(size=3)),
                NOT_ROWS | {"no direction": ((0, 0, 0), (0, 0, 0)), "nan": ((0, 0, NAN), (0, 0, 1))},
            ).but("none"),
            "triangle": choice(None, text="blade", line=np.zeros((3, 3)), both=np.eye(3), two=np.eye(3)[:2]),
        }, perhaps),
        "force_across": Call({"point": POINT, "normal": WAY}),
        "watch_stress": Call({"threshold": THRESHOLD}),
        "watch_tearing": Call({"tear_stress": THRESHOLD}),
        "render_mesh": Call({"crease": or_none(number(0.0, 180.0, below=-1.0, above=181.0))}),
    },
    "Collider": {
        "set_friction": Call({"friction": FRICTION}),
        "set_filter": Call({"group": GROUP, "mask": GROUP}),
        "set_surface_velocity": Call({"velocity": BELT}),
        "move_to": Call({"position": POINT, "rotation": ROTATION}),
        "set_velocity": Call({"linear": vector(-0.5, 0.5, fast=(0.0, 2e4, 0.0)), "angular": vector(-2.0, 2.0, fast=(2e4, 0.0, 0.0))}),
        "teleport": Call({"position": POINT, "rotation": ROTATION}),
        "remove": NOTHING,
    },
    "Frame": {
        "move_to": Call({"position": POINT, "rotation": ROTATION}),
        "teleport": Call({"position": POINT, "rotation": ROTATION, "keep_velocity": FLAG}, _hangs_elsewhere),
        "remove": NOTHING,
    },
    "Grab": {"move": Call({"point": POINT}), "release": NOTHING},
    "Attachment": {"release": NOTHING, "set_break_force": Call({"force": BREAK_FORCE})},
    "Joint": {"release": NOTHING, "set_break_force": Call({"force": BREAK_FORCE})},
    "Motor": {
        "set_speed": Call({"speed": number(-5.0, 5.0, fast=1e5)}),
        "set_limit": Call({"limit": number(0.0, 9.0, below=-1.0, strong=1e13)}),
        "remove": NOTHING,
    },
    "Listener": {"remove": NOTHING},
    "EngineAdapter": {
        "step": NOTHING,
        "advance": Call({"frame_dt": number(0.0, 0.05, below=-0.1)}),
        "rewind": Call({"steps": choice(1, 2, 3, **NOT_COUNTS, zero=0)}, _is_not_kept),
        "snapshot": NOTHING,
        "restore": Call({"data": DATA}),
        "state_hash": NOTHING,
        "drain_events": NOTHING,
        "see_from": Call({"viewer": POINT}),
        "positions": Call({"body": BODY, "out": BUFFER}),
        "render_mesh": Call({"mesh": DRAWN, "positions": DRAWN_BUFFER, "normals": DRAWN_BUFFER}),
    },
    "Rollback": {
        "save": NOTHING,
        "rewind_to": Call({"step": Kind(lambda g, rng: one_of(g.rollback.steps[-1:], rng), NOT_COUNTS | {"never": 10**6})}, _is_not_kept),
    },
}  # fmt: skip

READERS: dict[str, str] = {
    "World": """bodies colliders dropped_events floor_collider frames grabs is_built islands joints last_dt motors restore_count settings slot_count step_count
        time""",
    "Body": """aabb angular_momentum asset attachments center_of_mass deformations elastic_energy failure flipped_count flipped_tets friction
        exact_positions gravitational_energy gravity_scale group index is_alive is_asleep is_cut is_enabled is_frozen is_held is_sheltered
        kinetic_energy level linear_damping mask masses material mesh momentum pinned plastic_strains pose render_meshes
        solve_residual stable_step strains stresses surface
        tet_origins tet_strain tet_stress tets topology_version velocities vertex_count vertex_origins vertex_strain
        vertex_stress volume volumes""",
    "Collider": """angular_impulse angular_velocity bodies_inside friction group impulse index is_alive is_sensor mask position restitution
        rotation shape surface_velocity thickness velocity""",
    "Frame": """is_alive position rotation""",
    "Grab": """body force is_held point""",
    "Attachment": """body break_force force frame is_attached particles torque two_way""",
    "Joint": """body break_force force is_attached other particles""",
    "Motor": """body effort is_mounted limit measured_speed particles speed turns""",
    "Listener": """function is_active kind""",
    "EngineAdapter": """alpha budget_status dropped_time fixed_step time total_dropped_time world""",
    "Rollback": """steps""",
}
"""Names of attributes and methods without arguments that change nothing, by class."""

DEAD = {"Body": "dead_body", "Collider": "dead_collider", "Frame": "dead_frame", "Grab": "dead_grab"}
DEAD |= {"Attachment": "dead_hold", "Joint": "dead_joint", "Motor": "dead_motor"}

READABLE_WHEN_DEAD: dict[str, str] = {
    "Body": """asset friction index is_alive is_cut is_frozen level masses material mesh render_meshes surface tet_origins tets topology_version
        vertex_count vertex_origins""",
    "Collider": """angular_velocity friction group index is_alive is_sensor mask position restitution rotation shape
        surface_velocity thickness velocity""",
    "Frame": "is_alive",
    "Grab": "body is_held point",
    "Attachment": "body break_force frame is_attached particles two_way",
    "Joint": "body break_force is_attached other particles",
    "Motor": "body is_mounted limit particles speed turns",
}

LENGTH = number(0.1, 1.0, zero=0.0, below=-1.0, long=1e7)
ANY_FLAG = choice(True, False, number=1, text="yes")
OPEN, INVERTED = (BLOCK.vertices, BLOCK.surface[1:]), (BLOCK.vertices, BLOCK.surface[:, ::-1])
MESH = choice(
    BLOCK, none=None, text="cube", number=1, open=OPEN, inverted=INVERTED, rows=np.zeros((3, 3)),
    flat=([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]]), empty=([], []), text_rows=("a", "b"),
    nan=(BLOCK.vertices * NAN, BLOCK.surface), far=(BLOCK.vertices, BLOCK.surface + 99), one=(BLOCK.vertices,),
)  # fmt: skip
MODULUS = number(1e4, 1e5, zero=0.0, below=-1.0)
CONSTANT, DAMPING = (kind.but("list", "array") for kind in (MODULUS, number(0.0, 9.0, below=-1.0)))
SOFT_MESH = choice(BLOCK, none=None, text="cube", number=1, rows=BLOCK.vertices, rope=rope(1.0, 4, mass=0.1))
BITS = choice(1, 2, **NOT_COUNTS).but("none")
NAME_OF = {"none": None, "number": 1, "text": "no such name", "list": ["virial"]}
OPTIONAL = {"number": 1, "text": "no such name", "list": ["virial"], "object": object()}
MAKERS: dict[Any, dict[str, Kind]] = {
    World: {
        "gravity": vector(-9.0, 9.0), "floor": or_none(number(-1.0, 1.0, low=-1e7)),
        "restitution": or_none(number(0.0, 1.0, above=1.1)), "friction": number(0.0, 1.0, below=-1.0),
        "integrator": choice("leapfrog", **NAME_OF), "tolerance": number(1e-4, 0.1, zero=0.0, above=0.6),
        "most_iterations": choice(100, **NOT_COUNTS, zero=0), "schedule": choice("auto", **NAME_OF),
        "soft_contact": or_none(ANY_FLAG), "sleep_speed": or_none(number(0.0, 1.0, below=-1.0)),
        "collider_room": or_none(choice(2, **NOT_COUNTS)),
        "sample_room": choice(8, **NOT_COUNTS), "retries": choice(0, **NOT_COUNTS),
        "max_substeps": or_none(choice(500, **NOT_COUNTS, zero=0)),
        "record": choice(2, **NOT_COUNTS), "record_to": choice("a", none=None, number=1, empty="", nul="\0"),
    },
    SoftBodyAsset: {
        "mesh": SOFT_MESH, "material": choice(SOFT, none=None, text="rubber", springs=SpringMaterial(500.0, 0.2)),
        "law": choice("virial", **OPTIONAL), "strain": choice(None, **OPTIONAL), "flips": choice(None, **OPTIONAL),
        "damping_model": choice("edge", **NAME_OF), "pinned": Kind(lambda g, rng: [0], NOT_VERTICES).but("empty"),
        "contact": choice(Contact(), none=None, number=1, text="soft"), "plasticity": choice(None, number=1, text="soft"),
        "spare_vertices": choice(4, **NOT_COUNTS), "tearing": choice(None, number=1, text="soft"),
        "skin": choice((), none=None, number=1, text="no such file.obj", list=["virial"], flat=np.zeros((3, 3)), empty=([], []),
                       nan=(BLOCK.vertices * NAN, BLOCK.surface), far=(BLOCK.vertices, BLOCK.surface + 99)),
        "hull": choice(None, number=1, real=0.5, nan=NAN, text="no such file.obj", list=["virial"], object=object(),
                       flat=np.zeros((3, 3)), empty=([], []), far=(BLOCK.vertices, BLOCK.surface + 99)),
        "coarser": choice((), none=None, number=1, mesh=(BLOCK,), text="coarse"),
    },
    Contact: {
        "friction": number(0.0, 1.0, below=-1.0), "thickness": or_none(number(0.0, 0.1, below=-1.0)), "itself": ANY_FLAG,
        "group": BITS, "mask": BITS, "faces": ANY_FLAG,
    },
    Plasticity: {
        "yield_stress": choice(1e4, **NOT_NUMBERS, zero=0.0), "yield_strain": choice(None, both=0.1),
        "creep": MODULUS.but("inf"), "maximum": number(0.0, 1.0, above=11.0),
    },
    Tearing: {"stress": MODULUS, "most": choice(4, **NOT_COUNTS, zero=0)},
    Material: {
        "young": CONSTANT, "poisson": number(0.1, 0.4, above=0.5, below=-1.0).but("list", "array"),
        "density": CONSTANT, "damping": DAMPING, "shear_modulus": or_none(CONSTANT), "shear_damping": or_none(DAMPING),
        "damping_ratio": number(0.0, 1.0, below=-1.0, above=2e3),
    },
    SphereShape: {"radius": LENGTH},
    BoxShape: {"size": vector(0.1, 1.0, zero=(0.0, 1.0, 1.0), below=(-1.0, 1.0, 1.0))},
    CapsuleShape: {"radius": LENGTH, "length": LENGTH.but("zero")},
    PlaneShape: {"normal": vector(0.1, 1.0, zero=(0.0, 0.0, 0.0))},
    HeightFieldShape: {
        "heights": Kind(lambda g, rng: rng.uniform(0, 1, (3, 3)), NOT_ROWS | {
            "nan": np.full((3, 3), NAN), "row": np.zeros((1, 5)), "high": np.full((3, 3), 1e9), "flat": np.zeros(9),
        }),
        "spacing": LENGTH,
    },
    MeshShape: {"mesh": MESH, "cell": or_none(number(0.05, 0.1, zero=0.0, fine=1e-6)), "cache": ANY_FLAG},
    FixedStep: {"dt": STEP_LENGTH, "substeps": SUBSTEP_COUNT, "max_steps": choice(8, **NOT_COUNTS, zero=0)},
    EngineAdapter: {
        "world": Kind(lambda g, rng: g.world, {"none": None, "number": 1, "not built": Of(lambda g: g.other)}),
        "fixed_step": choice(FixedStep(), number=DT, text="fast"), "before_step": choice(None, print_nothing, number=1),
        "rewind_ticks": choice(0, 2, **NOT_COUNTS), "budget_ms": or_none(MODULUS),
    },
    Rollback: {
        "world": Kind(lambda g, rng: g.world, {"none": None, "number": 1, "not built": Of(lambda g: g.other)}),
        "ticks": choice(2, **NOT_COUNTS, zero=0),
    },
    RollbackSession: {
        "world": Kind(lambda g, rng: g.world, {"none": None, "number": 1, "not built": Of(lambda g: g.other)}),
        "act": choice(print_nothing, none=None, number=1), "player": choice(0, 1, **NOT_COUNTS, another=2),
        "players": choice(2, **NOT_COUNTS, one=1, seventeen=17), "input_size": choice(1, 64, **NOT_COUNTS, zero=0),
        "step": choice(None, FixedStep(), number=DT), "ticks": choice(3, 1000, **NOT_COUNTS, zero=0),
        "delay": choice(0, 3, **NOT_COUNTS, beyond=1001), "hash_every": choice(1, 60, **NOT_COUNTS, zero=0),
        "patience": choice(1, 600, **NOT_COUNTS, zero=0),
    },
}  # fmt: skip
"""Arguments of objects that are created before a world, or independently of one."""
