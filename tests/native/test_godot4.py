"""The library for Godot 4, built by Godot's own header and run by a stand-in: no Godot 4 was at hand."""

import re
import subprocess

import numpy as np
import pytest
from games import hash_of, line, lines_of
from godot4_host import GODOT, LIBRARY, VERSIONS, Name, Transform, registered, transform
from godot_games import HALF_TURN, UPRIGHT, levels_game
from native_build import ROOT

pytestmark = [pytest.mark.soak, pytest.mark.guard]

DT = 1 / 64


@pytest.fixture(scope="module")
def world(export):
    return export("heap", "--axes", "y-up")


@pytest.fixture
def native_world(host, world):
    """An instance with a world."""
    instance = host.new()
    assert instance.load(str(world)) is True
    yield instance
    instance.free()


def test_a_class_is_registered_with_the_scene_and_taken_out_again(host):
    assert host.started[:2] == ["started at 2", "class SoftWorldNative RefCounted at 2"]
    assert host.started[-1] == "ready, left 0"
    source = (GODOT / "src" / "world_native.cpp").read_text(encoding="utf-8")
    table = re.findall(r'^    \{"(\w+)", (\d+), \w+\},$', source, re.MULTILINE)
    assert len(table) > 30
    assert registered(host) == {name: int(count) for name, count in table}
    assert len(host.started) == len(table) + 3  # none of them twice
    for row in host.started:
        if row.startswith("method "):
            _, _, count, flags, has_result, *names = row.split()
            assert (flags, has_result) == ("1", "1")
            assert names == [f"argument_{i + 1}" for i in range(int(count))]


def test_no_method_hides_one_of_godot(host, api):
    for version in VERSIONS:
        classes = {each["name"]: each for each in api[version]["classes"]}
        theirs = {method["name"] for name in ("Object", "RefCounted") for method in classes[name]["methods"]}
        assert not theirs & set(registered(host))


@pytest.mark.parametrize("version", VERSIONS)
def test_it_compiles_against_the_header_of_every_version(interfaces, version):
    for source in sorted((GODOT / "src" / "godot4").glob("*.cpp")):
        folders = ["-I", source.parent, "-I", ROOT / "engine_adapter/native/include"]
        command = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *folders]
        command += ["-isystem", interfaces[version], source]
        done = subprocess.run([str(each) for each in command], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_sizes_hashes_and_constructors_are_those_of_every_version(api):
    """The values are those in src/godot4/variant.cpp."""
    sizes = {"Variant": 24, "Vector3": 12, "Transform3D": 48, "int": 8, "float": 8, "bool": 1}
    sizes |= {"String": 8, "StringName": 8, "Array": 8}
    arrays = ("PackedByteArray", "PackedInt32Array", "PackedVector2Array", "PackedVector3Array")
    sizes |= dict.fromkeys(arrays, 16)
    for told in api.values():
        (single,) = (
            each for each in told["builtin_class_sizes"] if each["build_configuration"] == "float_64"
        )
        assert sizes.items() <= {each["name"]: each["size"] for each in single["sizes"]}.items()
        types = {each["name"]: each for each in told["builtin_classes"]}
        for name in ("Array", *arrays):
            methods = {method["name"]: method for method in types[name]["methods"]}
            assert (methods["resize"]["hash"], methods["size"]["hash"]) == (848867239, 3173160232)
            assert "arguments" not in types[name]["constructors"][0]
        for name, which, taken in (
            ("String", 2, ["StringName"]),
            ("StringName", 2, ["String"]),
            ("Vector3", 3, ["float"] * 3),
        ):
            found = types[name]["constructors"][which]
            assert found["index"] == which
            assert [each["type"] for each in found["arguments"]] == taken
        (usage,) = (each for each in told["global_enums"] if each["name"] == "PropertyUsageFlags")
        flags = {each["name"]: each["value"] for each in usage["values"]}
        assert flags["PROPERTY_USAGE_DEFAULT"] == 6
        assert flags["PROPERTY_USAGE_NIL_IS_VARIANT"] == 131072


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--without", "variant_get_type"], "this Godot lacks function variant_get_type, which 4.1"),
        (
            ["--without", "classdb_register_extension_class"],
            "this Godot lacks function classdb_register_extension_class",
        ),
        (["--without", "print_error"], "this Godot lacks function print_error"),
        (["--without", "resize"], "this Godot lacks resize of type 28"),
        (["--double"], "this Godot is built with double precision"),
        (["--old"], "this is Godot 4.0: use 4.1 or later"),
    ],
)
def test_a_godot_that_lacks_something_is_refused_in_one_line(godot4, options, said):
    command = [godot4 / "bin" / "fake_host", godot4 / "bin" / LIBRARY, *options]
    done = subprocess.run([str(each) for each in command], input="", capture_output=True, text=True)
    assert done.returncode == 0
    printed = done.stdout.splitlines() + done.stderr.splitlines()
    assert "refused, left 0" in printed
    (text,) = (row for row in printed if not row.startswith("refused"))
    assert "taichi_soft_godot_init" in text
    assert said in text


HELD = {  # by step
    0: [line("record_events", 31)],
    10: [
        line("add_frame", (0.5, 1.0, 0.25), UPRIGHT),
        line("grab", 5, 5, (0.5, 0.25, 0.25), (1.5, 1.5, 0.0), 4.0, -1.0),
    ],
    50: [line("move_grab", 0, (1.25, 1.25, 0.5)), line("attach", 0, [3, 1, 12], 0, 1)],
    70: [line("grab_force", 0), line("load", 0, 0), line("release_grab", 0)],
    80: [line("move_frame", 0, (0.5, 1.125, 0.25), UPRIGHT)],
    90: [
        line("gravity", (0.5, 0.25, -9.5)),
        line("floor_friction", 0.75),
        line("body_friction", 5, 0.25),
        line("collider_friction", 0, 0.125),
        line("join", 6, [3, 1], 5, [5, 7]),
        line("add_motor", 5, [0, 1, 2, 9], 1, 0, 0, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), 2.0, 8.0),
    ],
    140: [
        line("motor_speed", 0, -4.0),
        line("joint_force", 0),
        line("motor_state", 0),
        line("release_joint", 0),
    ],
    155: [line("motor_limit", 0, 2.0)],
    180: [line("remove_motor", 0)],
    150: [line("detach", 0, [1]), line("grab", 0, 7, (0.0, 1.0, 0.0), (-1.5, 2.0, 0.0), 8.0, 64.0)],
    210: [line("add_frame", (0.0, 1.0, 0.0), UPRIGHT), line("remove_frame", 1), line("detach", 0, [])],
}


def game():
    """Calls in numbers that Godot's 32 bits hold exactly. Slots: 0 to 4 balls, 5 to 9 bricks."""
    yield line("add_collider", 2, (2.0, 0.25, 2.0), 0.875, -1.0, 0.0, 1, -1, (0.0, 0.25, -1.5), UPRIGHT)
    for i in range(240):
        if i < 160:
            yield line("move_collider", 0, (i / 512, 0.25 + (i % 32) / 1024, 0.0), UPRIGHT)
        if i in HELD:
            yield from HELD[i]
        if i == 40:
            yield line("spawn", 0, (0.25, 2.0, 0.125), HALF_TURN, (0.0, -1.0, 0.25), (0.0, 2.0, 0.0))
            yield line("velocity", 5, (0.5, 1.0, 0.0), (0.0, 0.0, 1.0))
        if i == 100:
            yield line("snapshot")
        if i == 130:
            yield line("restore")
        if i == 200:
            yield line("despawn", 1)
        yield line("step", DT, 0)
        if i % 60 == 59:
            yield line("status", 3)
            yield line("mesh", 0, 0)
            yield line("mesh", 5, 1)
            yield line("drain")
            yield line("overlap_sphere", (1.25, 0.25, 0.0), 0.25)
            yield line("overlap_box", (0.0, 0.5, 0.0), HALF_TURN, (0.5, 1.0, 4.0))
            yield line("raycast", (1.25, 4.0, 0.0), (0.0, -1.0, 0.0), 8.0)


def slot(body):
    return (body & 0xFFFFFFFF) - 1


class Player:
    """Plays a game by the methods of an instance, and notes what play.c prints."""

    def __init__(self, instance):
        self.instance, self.lines, self.kept = instance, [], b""

    def play(self, game):
        for text in game:
            call, *rest = text.split()
            self.numbers = [float(each) for each in rest]
            getattr(self, call)()
        return self.lines

    def take(self, count):
        found, self.numbers = self.numbers[:count], self.numbers[count:]
        return tuple(found)

    def whole(self):
        return int(self.take(1)[0])

    def list(self):
        return [int(each) for each in self.take(self.whole())]

    def place(self):
        origin, turn = self.take(3), self.take(4)
        return transform(origin, {UPRIGHT: (1, 1, 1), HALF_TURN: (-1, 1, -1)}[turn])

    def body(self):
        return self.instance.body(self.whole())

    def say(self, text):
        self.lines.append(str(text))

    def step(self):
        assert self.instance.step(*self.take(1), self.whole()) is True
        self.say(self.instance.state_hash())

    def add_collider(self):
        kind, size = self.whole(), self.take(3)
        friction, restitution, thickness, group, mask = self.take(5)
        surface = friction, restitution, thickness, int(group), int(mask)
        self.say(self.instance.add_collider(kind, size, self.place(), *surface))

    def move_collider(self):
        assert self.instance.move_collider(self.whole(), self.place()) is True

    def spawn(self):
        asset, place = self.whole(), self.place()
        assert self.instance.spawn(asset, place, self.take(3), self.take(3)) > 0

    def despawn(self):
        assert self.instance.despawn(self.body()) is True

    def velocity(self):
        body = self.body()
        assert self.instance.set_velocity(body, self.take(3), self.take(3)) is True

    def record_events(self):
        assert self.instance.record_events(self.whole()) is True

    def drain(self):
        found = self.instance.drain_events()
        self.say(f"events {len(found) // 8}")
        for i in range(0, len(found), 8):
            kind, body, other, collider, impulse, duration, step, time = found[i : i + 8]
            row = hash_of([time, *impulse, duration])
            self.say(f"{kind} {collider} {step} {slot(body)} {slot(other)} {row}")

    def say_bodies(self, found):
        self.say(" ".join(str(slot(body)) for body in found) or "nothing")

    def overlap_sphere(self):
        self.say_bodies(self.instance.overlap_sphere(self.take(3), *self.take(1)))

    def overlap_box(self):
        self.say_bodies(self.instance.overlap_box(self.place(), self.take(3)))

    def raycast(self):
        found = self.instance.raycast(self.take(3), self.take(3), *self.take(1))
        if not found:
            self.say("nothing")
            return
        body, _, distance, point, normal, weights, vertices = found
        row = hash_of([distance, *weights, *point, *normal])
        self.say(" ".join(map(str, [slot(body), *vertices, row])))

    def grab(self):
        body, triangle, weights, point = self.body(), self.whole(), self.take(3), self.take(3)
        assert self.instance.grab(body, triangle, weights, point, *self.take(2)) > 0

    def grab_of(self):
        return self.instance.grab_of(self.whole())

    def move_grab(self):
        assert self.instance.move_grab(self.grab_of(), self.take(3)) is True

    def release_grab(self):
        assert self.instance.release_grab(self.grab_of()) is True

    def grab_force(self):
        self.say(hash_of(self.instance.grab_force(self.grab_of())))

    def gravity(self):
        assert self.instance.set_gravity(self.take(3)) is True

    def floor_friction(self):
        assert self.instance.set_friction(*self.take(1)) is True

    def body_friction(self):
        assert self.instance.set_body_friction(self.body(), *self.take(1)) is True

    def collider_friction(self):
        assert self.instance.set_collider_friction(self.whole(), *self.take(1)) is True

    def join(self):
        self.say(slot(self.instance.join(self.body(), self.list(), self.body(), self.list())))

    def joint_of(self):
        return self.instance.joint_of(self.whole())

    def joint_force(self):
        self.say(hash_of(self.instance.joint_force(self.joint_of())))

    def release_joint(self):
        assert self.instance.release_joint(self.joint_of()) is True

    def add_motor(self):
        body, vertices, kinds = self.body(), self.list(), [self.whole() for _ in range(3)]
        self.say(
            slot(self.instance.add_motor(body, vertices, *kinds, self.take(3), self.take(3), *self.take(2)))
        )

    def motor_of(self):
        return self.instance.motor_of(self.whole())

    def motor_speed(self):
        assert self.instance.set_motor_speed(self.motor_of(), *self.take(1)) is True

    def motor_limit(self):
        assert self.instance.set_motor_limit(self.motor_of(), *self.take(1)) is True

    def motor_state(self):
        self.say(hash_of(self.instance.motor_state(self.motor_of())))

    def remove_motor(self):
        assert self.instance.remove_motor(self.motor_of()) is True

    def add_frame(self):
        self.say(self.instance.add_frame(self.place()))

    def remove_frame(self):
        assert self.instance.remove_frame(self.whole()) is True

    def move_frame(self):
        assert self.instance.move_frame(self.whole(), self.place()) is True

    def attach(self):
        assert self.instance.attach(self.body(), self.list(), self.whole(), self.whole()) is True

    def detach(self):
        assert self.instance.detach(self.body(), self.list()) is True

    def load(self):
        force, torque = self.instance.frame_load(self.body(), self.whole())
        self.say(hash_of([*force, *torque]))

    def snapshot(self):
        self.kept = self.instance.snapshot()

    def restore(self):
        assert self.instance.restore(self.kept) is True

    def impulse(self):
        assert self.instance.apply_impulse(self.body(), self.take(3)) is True

    def wake(self):
        assert self.instance.wake() is True

    def set_level(self):
        assert self.instance.set_level(self.body(), self.whole(), self.whole()) is True

    def level(self):
        body = self.body()
        self.say(f"{self.instance.get_level(body)} {self.instance.vertex_count(body)}")

    def positions(self):
        self.say(hash_of(self.instance.positions(self.body())))

    def collider_impulse(self):
        impulse, moment = self.instance.collider_impulse(self.whole())
        self.say(hash_of([*impulse, *moment]))

    def status(self):
        self.say(self.instance.status(self.body()))

    def mesh(self):
        body = self.body()
        positions, normals = self.instance.mesh(body, self.whole())
        self.say(f"{hash_of(positions)} {hash_of(normals)}")


def test_a_game_has_the_same_bits_as_in_c(native_world, world, play):
    calls = list(game())
    found = Player(native_world).play(calls)
    assert len(set(found)) > 200
    assert found == lines_of([play, world], calls)
    assert native_world.host.errors == []


def test_a_game_with_levels_of_detail_has_the_same_bits_as_in_c(host, export, play):
    calls, folder, instance = list(levels_game()), export("levels"), host.new()
    assert instance.load(str(folder)) is True
    found = Player(instance).play(calls)
    assert len(set(found)) > 400
    assert found == lines_of([play, folder], calls)
    assert host.errors == []
    instance.free()


def test_what_is_read_is_what_the_library_has(native_world):
    """Values of each output type are compared."""
    native = native_world
    assert [native.count(kind) for kind in range(5)] == [10, 2, 4, 0, 2]
    brick = native.name_of(1, 1)
    assert native.find(1, brick) == native.find(1, Name(brick)) == 1
    asset, vertices, triangles, has_uv, level = native.mesh_info(0)
    assert (asset, has_uv, level) == (0, 0, 0)
    assert native.uvs(0).shape == (0, 2)
    body = native.body(0)
    positions, normals = native.mesh(body, 0)
    assert positions.shape == normals.shape == (vertices, 3)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    corners = positions[native.triangles(0).reshape(-1, 3)].astype(float)
    assert len(corners) == triangles
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 2], corners[:, 1])).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 0.25**3, rel=0.2)  # fronts are clockwise, as in Godot
    assert native.center(body) == pytest.approx((0.0, 0.9, 0.0), abs=0.02)  # y is up
    assert len(native.positions(body)) >= len(np.unique(native.triangles(0)))
    assert native.positions(body).mean(axis=0) == pytest.approx((0.0, 0.9, 0.0), abs=0.02)
    native.apply_impulse(body, (0.0, 5.0, 0.0))
    assert native.set_fixed_step(DT, 0, 4) is True
    assert native.advance(2.5 * DT) == 2
    impulse, moment = native.collider_impulse(3)
    assert len(impulse) == len(moment) == 3
    assert native.by_pointers("center", body) == native.center(body)
    assert native.by_pointers("state_hash") == native.state_hash()
    assert native.by_pointers("status", 12345) is None
    (error,) = native.host.errors
    assert error.startswith("status body 12345 is not in this world")


def test_who_falls_asleep_and_who_wakes_is_told_once(native_world):
    native = native_world
    assert native.record_events(4 | 8) is True
    asleep = set()
    for i in range(900):
        assert native.step(DT, 0) is True
        events = native.drain_events()
        for event in range(0, len(events), 8):
            kind, body, *rest, time = events[event : event + 8]
            assert (kind, rest) == (4, [0, -1, (0.0, 0.0, 0.0), 0.0, i])
            assert time == pytest.approx((i + 1) * DT)
            assert native.status(body) == 2
            assert body not in asleep
            asleep.add(body)
        if len(asleep) >= 3:
            break
    assert len(asleep) >= 3
    native.wake()
    assert native.drain_events() == []
    native.step(DT, 0)
    events = native.drain_events()
    assert events[::8] == [8] * len(asleep)
    assert set(events[1::8]) == asleep
    assert native.drain_events() == []
    assert native.dropped_events() == 0


def test_more_events_than_fit_at_once_are_drained(native_world):
    """The library returns them in portions of 256."""
    native = native_world
    assert native.record_events(31) is True
    bodies = [native.body(slot) for slot in range(9) if native.body(slot) > 0]
    for i in range(1200):
        if i % 24 == 0:  # they jump
            for body in bodies:
                native.set_velocity(body, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0))
        native.step(DT, 0)
    events = native.drain_events()
    assert len(events) > 300 * 8
    assert events[6::8] == sorted(events[6::8])
    assert {type(each) for each in events[::8] + events[1::8] + events[6::8]} == {int}
    assert native.drain_events() == []


def test_a_frame_is_where_it_was_put(native_world):
    """The rotation is about an oblique axis. It is converted to the library's quaternion and back."""
    axis, angle = np.array([0.6, 0.0, 0.8]), 2.0
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    place = Transform([*turn.ravel().tolist(), 0.25, -3.0, 0.5])
    frame = native_world.add_frame(place)
    assert native_world.frame_pose(frame) == pytest.approx(place, abs=1e-6)


def test_a_hand_and_a_frame_hold_a_body(native_world):
    native = native_world
    ball = native.body(1)
    body, triangle, distance, point, normal, weights, vertices = native.raycast(
        (0.05, 9.0, -0.03), (0.0, -2.0, 0.0), float("inf")
    )
    top = native.body(2)
    assert (body, normal[1] > 0.9) == (top, True)
    assert point == pytest.approx((0.05, 9.0 - distance, -0.03), abs=1e-5)
    corners = native.positions(body)[vertices]
    assert np.array(weights) @ corners == pytest.approx(np.array(point), abs=1e-5)
    assert native.raycast((0.0, 9.0, 0.0), (0.0, 1.0, 0.0), 5.0) == []
    grab = native.grab(body, triangle, weights, (0.0, 3.0, 0.0), 5.0, -1.0)
    assert grab == native.grab_of(0) > 0
    assert native.grab_of(1) == 0
    frame = native.add_frame(transform())
    assert native.attach(ball, [0, 1, 2], frame, 1) is True
    assert native.move_frame(frame, transform((0.0, 0.0, -1.0))) is True
    for _ in range(120):
        assert native.step(DT, 0) is True
    assert native.center(top)[1] > 2.5
    assert native.overlap_sphere(native.center(top), 0.1) == [top]
    assert native.overlap_box(transform(native.center(ball)), (0.1, 0.1, 0.1)) == [ball]
    force, torque = native.frame_load(ball, frame)
    assert force[1] < 0.0
    assert len(torque) == 3
    assert native.grab_force(grab)[1] > 0.0
    assert native.release_grab(grab) is True
    assert native.detach(ball, [0]) is True
    assert native.remove_frame(frame) is True
    assert native.host.errors == []


def test_bad_arguments_are_errors_and_no_crash(host, world):
    native, upright = host.new(), transform()
    still = (0.0, 0.0, 0.0)
    nan = float("nan")
    refused = [
        ("load", ["no/such/folder"], "cannot read no/such/folder/world.tsw"),
        ("load", [7], "argument 1 is not a String"),
        ("state_hash", [], "world 0 does not exist"),
        ("mesh_info", [0], "scene 0 does not exist"),
        ("load", [str(world)], None),
        ("status", [12345], "body 12345 is not in this world"),
        ("despawn", ["rider"], "argument 1 is not a whole number"),
        ("despawn", [None], "argument 1 is not a whole number"),
        ("step", [DT], "takes 2 arguments, got 1"),
        ("step", [DT, 0, 0], "takes 2 arguments, got 3"),
        ("step", [], "takes 2 arguments, got 0"),
        ("step", ["soon", 0], "argument 1 is not a number"),
        ("advance", [-1.0], "seconds is -1"),
        ("advance", [nan], "seconds is -?nan"),
        ("spawn", [99, upright, still, still], r"asset 99 does not exist \(2 in all"),
        ("spawn", [0, transform((nan, 0, 0)), still, still], "position has -?nan in it"),
        ("spawn", [0, still, still, still], "argument 2 is not a Transform3D"),
        ("spawn", [0, upright, 1.0, still], "argument 3 is not a Vector3"),
        ("move_collider", [0, transform(diagonal=(1, 1, -1))], "argument 2 is a Transform3D that mirrors"),
        ("teleport_collider", [0, transform(diagonal=(0, 0, 0))], "argument 2 is a Transform3D without size"),
        ("move_frame", [7, upright], "frame 7 does not exist"),
        ("find", [0, "nobody"], "unknown name nobody"),
        ("find", [0, Name("nobody")], "unknown name nobody"),
        ("record_events", [512], "kinds is 512"),
        ("raycast", [still, still, 1.0], "direction has zero length"),
        ("raycast", [still, (nan, 0.0, 0.0), 1.0], "direction has -?nan in it"),
        ("overlap_sphere", [still, -1.0], "radius is -1"),
        ("overlap_sphere", [upright, 1.0], "argument 1 is not a Vector3"),
        ("overlap_box", [transform(diagonal=(1, 0, 1)), still], "argument 1 is a Transform3D without size"),
        ("overlap_box", [upright, still], "size"),
        ("grab", [12345, 0, (1.0, 0.0, 0.0), still, 5.0, -1.0], "body 12345 is not in this world"),
        ("grab_of", [16], "number is 16: give 0 to 15"),
        ("move_grab", [7, still], "grab 7 is not in this world, or was released"),
        ("release_grab", [0], "grab 0 is not in this world, or was released"),
        ("grab_force", [-1], "grab 18446744073709551615 is not in this world"),
        ("add_frame", [still], "argument 1 is not a Transform3D"),
        ("remove_frame", [3], "frame 3 does not exist"),
        ("frame_pose", [-1], "frame -1 does not exist"),
        ("attach", [12345, [0], 0, 0], "body 12345 is not in this world"),
        ("attach", [12345, (0.0, 1.0, 2.0), 0, 0], "argument 2 is not a PackedInt32Array"),
        ("detach", [12345, []], "body 12345 is not in this world"),
        ("frame_load", [12345, 0], "body 12345 is not in this world"),
        ("positions", [12345], "body 12345 is not in this world"),
        ("set_level", [12345, 0, 0], "body 12345 is not in this world"),
        ("set_level", [12345, 1.0, 0], "argument 2 is not a whole number"),
        ("get_level", [12345], "body 12345 is not in this world"),
        ("vertex_count", [12345], "body 12345 is not in this world"),
        ("level_count", [2], r"asset 2 does not exist \(2 in all"),
        ("count", [9], "argument 1 is 9: give a kind from 0 to 4"),
        ("count", [True], "argument 1 is not a whole number"),
        ("restore", [b"abc"], "3 bytes are not a snapshot"),
        ("restore", [b""], "bytes is null"),
        ("restore", ["abc"], "argument 1 is not a PackedByteArray"),
        ("body", [1 << 40], "argument 1 is 1099511627776: too large"),
    ]
    for name, arguments, said in refused:
        answer = getattr(native, name)(*arguments)
        if said is None:
            assert answer is True
            continue
        assert answer is None, name
        assert re.match(said, native.last_error()), name
        assert re.match(f"{name} {said}", host.errors.pop()), name
        assert host.errors == []
    assert native.load("no/such/folder") is None  # and what was loaded is given back
    assert native.state_hash() is None
    native.free()


def test_instances_are_apart_and_may_be_freed_with_their_world(host, world):
    first, second = host.new(), host.new()
    for instance in (first, second):
        assert instance.load(str(world)) is True
    before = first.state_hash()
    assert second.state_hash() == before
    second.step(DT, 0)
    assert second.state_hash() != before
    assert first.state_hash() == before
    first.free()
    assert second.step(DT, 0) is True
    assert second.unload() is True
    assert second.step(DT, 0) is None
    second.free()
