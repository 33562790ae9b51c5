"""Worlds to export, each with a game that uses its features: `GAMES` by name."""

import numpy as np
from games import line

from taichi_soft import (
    LAWS,
    BoxShape,
    CapsuleShape,
    Contact,
    HeightFieldShape,
    Material,
    MeshShape,
    PlaneShape,
    Plasticity,
    RodMaterial,
    RodMesh,
    ShellMaterial,
    ShellMesh,
    SoftBodyAsset,
    SphereShape,
    SpringMaterial,
    box,
    cloth,
    cloth_constants,
    load_mesh,
    rod,
    sheet,
    sphere,
)
from taichi_soft.core.package_data import ASSETS
from taichi_soft.world.bare import bare_world

DT = 1 / 64
STEPS = 600
RUBBER = Material(young=6e4, poisson=0.4, density=1000, damping_ratio=0.1)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def turn(axis, angle):
    """A unit quaternion."""
    axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return (*(np.sin(angle / 2) * axis), np.cos(angle / 2))


def heap():
    """Make a world with typical features of games: soft contact, sleep, pools, moving colliders."""
    world = bare_world(soft_contact=True, sleep_speed=0.4, collider_room=10)
    ball = SoftBodyAsset(sphere(radius=0.25, resolution=3), RUBBER, contact=Contact(thickness=0.005))
    brick = SoftBodyAsset(box((0.5, 0.4, 0.3), (3, 2, 2)), RUBBER)
    for asset, count in ((ball, 5), (brick, 5)):
        world.reserve(asset, count)
    for i in range(3):
        world.spawn(ball, position=(0.05 * i, 0.03 * i, 0.9 + 0.6 * i))
        world.spawn(brick, position=(1.2, 0.02 * i, 0.3 + 0.4 * i))
    world.spawn(brick, position=(-4.0, -4.0, 0.16))  # far from all others, so it soon falls asleep
    world.add_collider(BoxShape((1.0, 1.0, 0.3)), position=(0.0, 0.0, 0.2))
    world.add_collider(SphereShape(0.2), position=(3.0, 0.0, 0.5))
    world.add_collider(PlaneShape((-1.0, 0.0, 0.2)), position=(2.5, 0.0, 0.0))
    world.build()
    return world


def heap_game():
    """Colliders: 0 the lift, 1 a ball, 2 a wall, 3 the floor. Slots: 0 to 4 balls, 5 to 9 bricks, 8 apart."""
    rng = np.random.default_rng(7)
    for i in range(STEPS):
        if i in (0, 450, 470, 490):
            yield line("record_events", {0: 31, 450: 3, 470: 0, 490: 31}[i])
        if i in (210, 330):
            yield line("drain")
        if i < 250:
            height = 0.2 + 0.15 * np.sin(0.05 * i)
            yield line("move_collider", 0, (0.1 * np.cos(0.03 * i), 0.0, height), turn((0, 0, 1), 0.01 * i))
        if i == 260:
            yield line("drive_collider", 1, (-1.0, 0.0, 0.0), (0.0, 2.0, 1.0))
        if i == 380:
            yield line("teleport_collider", 1, (1.2, 0.0, 1.4), turn((1, 2, 3), 0.4))
            yield line("drive_collider", 1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        if i == 100:
            yield line("spawn", 0, (0.3, 0.1, 2.0), turn((1, 0, 1), 0.7), (0.5, 0.0, -1.0), (1.0, 2.0, 3.0))
            yield line("spawn", 1, (1.2, 0.1, 2.2), turn((0, 1, 1), 1.2), (0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
        if i == 200:
            yield line("despawn", 0)
        if i == 220:
            yield line("spawn", 0, (0.0, 0.0, 2.5), UPRIGHT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            yield line("snapshot")
        if i in (150, 290, 480):
            yield line("radial_impulse", rng.uniform(0, 1, 3), 40.0, 1.5)
        if i in (170, 310):
            yield line("impulse", 1, (5.0, 0.0, 20.0), [])
            yield line("impulse", 5, (0.0, 3.0, 10.0), [3, 0, 1, 2])
            yield line("impulse", 8, (0.0, 0.0, 30.0), [])
            yield line("force", 2, (0.0, 0.0, 400.0), [])
        if i in (130, 360):
            for kind, size in enumerate(((1, 1, 1), (0.2, 0, 0), (0.4, 0.3, 0.2), (0.1, 0.5, 0))):
                surface = (0.4, 0.3 if kind else -1.0, 0.01 * kind, 1, 15)
                place = (1.2, 0.4 * kind, -0.3), turn((1, 0, 0), 0.2 * kind)
                yield line("add_collider", kind, size, *surface, *place)
        if i == 160:
            yield line("remove_collider", 5)
            yield line("drive_collider", 6, (0.0, -0.3, 0.3), (0.0, 0.0, 2.0))
        if i == 320:
            yield line("teleport", 6, (1.3, 0.0, 1.5), turn((0, 0, 1), 1.0), 1)
            yield line("velocity", 2, (0.0, 0.5, 1.0), (0.0, 0.0, 3.0))
        if i == 340:
            yield line("restore")
        yield line("step", DT, 0)
        if i % 20 == 0:
            yield line(
                "raycast",
                (rng.uniform(-1, 2), -4.0, rng.uniform(0, 1)),
                (0.0, 1.0, rng.uniform(-0.1, 0.1)),
                9.0,
            )
            yield line("closest", rng.uniform(-1, 2, 3), 1.0)
        if i % 50 == 0:
            for collider in range(4):
                yield line("collider_impulse", collider)
                yield line("collider_pose", collider)
            for slot in (1, 5):
                yield line("status", slot)
                yield line("positions", slot, 1.0)
                yield line("positions", slot, 0.25)
                yield line("mesh", slot, int(slot == 5))
            yield line("drain")
            yield line("overlap_sphere", rng.uniform(0, 1.2, 3), 0.5)
            yield line("overlap_box", rng.uniform(0, 1.2, 3), turn((1, 2, 0), i), (0.8, 0.5, 0.3))
        if i in (420, 430):
            yield line("unpin", 1, [])  # nothing is pinned, but the call wakes the body
    yield line("stable_substeps", DT)


def free():
    """Make bodies that touch only the floor: frames, pins, forces and wind."""
    world = bare_world(floor=0.0, retries=2)
    beams = []
    for i in range(4):
        held = () if i else (0, 1, 2, 3)
        bar = box((1.0, 0.2, 0.2), (6, 1, 1))
        beams.append(world.add_body(bar, RUBBER, position=(0.0, 0.5 * i, 1.0), pinned=held))
    world.add_body(
        sphere(radius=0.3, resolution=4), RUBBER, position=(3.0, 0.0, 1.0), velocity=(0.0, 0.0, 2.0)
    )
    world.build()
    hand = world.add_frame((0.0, 0.5, 1.0))
    beams[1].attach([0, 1, 2, 3], hand, two_way=True)
    return world


def free_game():
    """Slots: 0 is pinned, 1 hangs from the frame, 2 and 3 are free, 4 is a ball."""
    for i in range(STEPS):
        yield line(
            "move_frame", 0, (0.2 * np.sin(0.04 * i), 0.5, 1.0), turn((0, 1, 0), 0.3 * np.sin(0.06 * i))
        )
        if i == 50:
            yield line("pin", 2, [7, 5, 6, 4])
        if 60 <= i < 120:
            rows = tuple((0.17 * k, 1.0, 0.6 + 0.004 * i) for k in range(3))
            yield line("targets", 2, [6, 4, 5], rows)
        if i == 130:
            yield line("unpin", 2, [5])
        if i == 180:
            yield line("unpin", 2, [])
        if i == 70:
            yield line("wind", (3.0, 1.0, 0.0), 1.2, 1.5)
            yield line("sheltered", 3, 1)
        if i == 400:
            yield line("despawn", 1)  # the body that was attached to the frame
        if i == 420:
            yield line("spawn", 1, (0.0, 0.5, 1.0), UPRIGHT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        if i == 250:
            yield line("sheltered", 3, 0)
            yield line("gravity_scale", 3, -0.2)
            yield line("damping", 4, 0.7)
        if i in (80, 90, 300):
            yield line("force", 3, (30.0, 0.0, 100.0), [])
            yield line("impulse_at", 4, (1.0, 2.0, 6.0), (3.0, 0.1, 0.7), 2.0)
        if i == 350:
            yield line("wind", (0.0, 0.0, 0.0), 0.0, 0.0)
            yield line("velocity", 3, (0.0, 1.0, 0.0), (4.0, 0.0, 0.0))
            yield line("teleport", 4, (3.0, 1.0, 2.0), turn((1, 1, 0), 2.0), 0)
        if i == 560:  # outside the valid range, so the body freezes
            yield line("record_events", 28)
            yield line("teleport", 3, (9.9999e6, 0.0, 5.0), UPRIGHT, 0)
            yield line("velocity", 3, (1.9e4, 0.0, 0.0), (0.0, 0.0, 0.0))
        if i == 570:
            yield line("drain")
            yield line("status", 3)
        yield line("step", DT, 0 if i % 3 else 12)
        if i % 60 == 0:
            for slot in range(5) if i != 420 else ():
                yield line("positions", slot, 0.5)
                yield line("status", slot)


def drape():
    """Cloth under implicit Euler falls over a ball that moves."""
    world = bare_world(integrator="implicit_euler", collider_room=1)
    mesh = cloth((1.2, 1.2), (8, 8), 0.3)
    constants = cloth_constants(mesh, (8, 8), tensile=400.0, shear=100.0, bend=1.0)
    world.add_body(mesh, SpringMaterial(constants, damping=0.05), position=(0.0, 0.0, 1.0))
    world.add_collider(SphereShape(0.3), position=(0.0, 0.0, 0.5))
    world.build()
    return world


def drape_game():
    for i in range(STEPS):
        yield line("move_collider", 0, (0.2 * np.sin(0.05 * i), 0.0, 0.5), UPRIGHT)
        if i == 100:
            yield line("pin", 0, [0, 8])
        yield line("step", DT, 0)
        if i % 100 == 0:
            yield line("collider_impulse", 0)
            yield line("mesh", 0, 0)


def shells():
    """Cloth with self-contact falls over a moving ball, and a curved shell falls on it."""
    world = bare_world(soft_contact=True, collider_room=2)
    linen = ShellMaterial(2e5, 0.3, 400, 2e-3, damping=0.02, bending_damping=2e-3)
    world.add_body(
        sheet((1.0, 1.0), (8, 8)),
        linen,
        position=(0.0, 0.0, 0.9),
        contact=Contact(itself=True, thickness=0.01),
    )
    flat = sheet((0.4, 0.4), (4, 4))
    bowl = flat.vertices + np.array([0.0, 0.0, 1.0]) * (flat.vertices**2).sum(axis=1)[:, None]
    material = ShellMaterial(3e5, 0.3, 800, 4e-3, bending_damping=1e-3)
    world.add_body(ShellMesh(bowl, flat.triangles), material, position=(0.1, 0.0, 1.4))
    world.add_collider(SphereShape(0.25), position=(0.0, 0.0, 0.5))
    world.build()
    return world


def shells_game():
    for i in range(450):
        yield line("move_collider", 0, (0.2 * np.sin(0.05 * i), 0.0, 0.5), UPRIGHT)
        if i == 50:
            yield line("grab", 0, 3, (0.2, 0.5, 0.3), (0.6, 0.3, 0.9), 4.0, -1.0)
        if i == 120:
            yield line("release_grab", 0)
            yield line("pin", 0, [0, 8])
        if i == 150:
            yield line("snapshot")
        if i == 300:
            yield line("restore")
        yield line("step", DT, 0)
        if i % 100 == 0:
            yield line("collider_impulse", 0)
            yield line("mesh", 0, 0)


def rods():
    """A hose that a frame twists over a moving ball, a ring, and coil springs from a pool; they touch."""
    world = bare_world(soft_contact=True, sleep_speed=0.05, collider_room=2)
    hose = RodMaterial(2e6, 0.45, 1000, 0.03, 0.02, damping=0.5, bending_damping=2e-3, torsion_damping=2e-4)
    line_of_hose = world.add_body(rod(1.6, 20), hose, position=(0.0, 0.0, 0.95), pinned=[0, 1])
    around = np.linspace(0.0, 2 * np.pi, 17)[:-1]
    ring = np.stack([0.3 * np.cos(around), 0.3 * np.sin(around), 0.05 * np.cos(2 * around)], axis=1)
    wire = RodMaterial(4e6, 0.3, 1200, 0.015, damping=0.3, bending_damping=1e-3)
    world.add_body(RodMesh(ring, closed=True), wire, position=(0.1, 0.0, 1.3))
    coil = np.linspace(0.0, 6 * np.pi, 43)
    spring = RodMesh(np.stack([0.1 * np.cos(coil), 0.1 * np.sin(coil), 0.02 * coil], axis=1))
    asset = SoftBodyAsset(spring, RodMaterial(4e6, 0.3, 1200, 0.01, bending_damping=1e-3))
    world.reserve(asset, 2)
    world.spawn(asset, position=(0.3, 0.1, 1.6), rotation=turn((1, 2, 0), 1.0))
    world.add_collider(SphereShape(0.25), position=(0.0, 0.0, 0.5))
    world.build()
    hand = world.add_frame((0.8, 0.0, 0.95))
    line_of_hose.attach([19, 20], hand, two_way=True)
    return world


def rods_game():
    """Slots: 0 is the hose, 1 the ring, 2 and 3 coil springs."""
    still = (0.0, 0.0, 0.0)
    for i in range(450):
        yield line("move_collider", 0, (0.2 * np.sin(0.05 * i), 0.0, 0.5), UPRIGHT)
        if i < 300:
            place = (0.8 - 0.2 * np.sin(0.02 * i), 0.1 * np.sin(0.03 * i), 0.95)
            yield line("move_frame", 0, place, turn((1, 0.2, 0), 0.04 * i))
        if i == 30:
            yield line("spawn", 2, (-0.4, 0.2, 1.3), turn((0, 1, 3), 2.0), still, (3.0, 1.0, 8.0))
        if i == 100:
            yield line("velocity", 2, (0.0, 0.5, 1.0), (0.0, 5.0, 2.0))
            yield line("damping", 3, 0.7)
        if i == 150:
            yield line("snapshot")
        if i == 200:
            yield line("teleport", 1, (0.0, 0.3, 1.2), turn((1, 1, 0), 2.0), 1)
            yield line("pin", 2, [0, 1])
        if i == 260:
            yield line("unpin", 2, [])
        if i == 300:
            yield line("restore")
        if i == 350:
            yield line("detach", 0, [])
        if i == 360:
            yield line("despawn", 2)
            yield line("spawn", 2, (0.2, -0.3, 1.1), UPRIGHT, (0.0, 0.0, 1.0), still)
        yield line("step", DT, 0 if i % 3 else 96)
        if i % 40 == 0:
            yield line("collider_impulse", 0)
            yield line("load", 0, 0) if i < 350 else line("status", 0)
            for slot in range(4 if i > 30 else 3):
                yield line("status", slot)
                yield line("positions", slot, 1.0)


def held():
    """Make bodies that are plastically bent, joined to each other, and pulled by a grab."""
    world = bare_world(soft_contact=True)
    tin = Plasticity(yield_stress=2e3, creep=20.0)
    block = world.add_body(box((0.6, 0.3, 0.3), (4, 2, 2)), RUBBER, position=(0, 0, 0.5), plasticity=tin)
    other = world.add_body(box((0.3, 0.3, 0.3), (2, 2, 2)), RUBBER, position=(0.46, 0, 0.5))
    ball = world.add_body(sphere(radius=0.2, resolution=3), RUBBER, position=(0.1, 0, 1.2))
    world.build()
    ends = np.flatnonzero(other.mesh.vertices[:, 0] < other.mesh.vertices[:, 0].min() + 1e-6)
    other.attach_to(block, ends)
    ball.grab(0).move((0.5, 0.2, 1.4))
    return world


def held_game():
    """Slots: 0 and 1 are joined, and 2 is the ball, which is already grabbed."""
    for i in range(STEPS):
        if i in (100, 200):
            yield line("impulse", 1, (0.0, 10.0, 30.0), [])
        if i == 60:
            yield line("move_grab", 0, (0.9, 0.4, 1.0))
            yield line("grab", 1, 3, (0.2, 0.5, 0.3), (0.8, 0.3, 0.9), 4.0, -1.0)
            yield line("grab", 1, 5, (1.0, 0.0, 0.0), (0.6, -0.3, 0.9), 7.0, 150.0)
            yield line("snapshot")
        if 150 <= i < 200:
            yield line("move_grab", 1, (0.8 + 0.01 * (i - 150), 0.3, 0.9))
        if i == 220:
            yield line("release_grab", 0)
        if i == 240:
            yield line("release_grab", 1)
            yield line("add_frame", (-0.3, 0.0, 0.4), turn((1, 1, 0), 0.5))
            yield line("add_frame", (0.0, 0.0, 1.0), turn((1, 1, 3), 0.9))
            yield line("attach", 0, [1, 0, 3], 0, 1)
            yield line("attach", 2, [4, 2], 1, 0)
        if 250 <= i < 380:
            yield line("move_frame", 0, (-0.3, 0.0, 0.4 + 0.004 * (i - 250)), turn((1, 1, 0), 0.01 * i))
        if i in (251, 300, 350):
            yield line("load", 0, 0)
            yield line("frame_pose", 0)
            yield line("grab_force", 2)
        if i == 320:
            yield line("remove_frame", 1)
            yield line("add_frame", (0.0, 0.5, 1.0), UPRIGHT)
        if i == 400:
            yield line("release_grab", 2)
            yield line("detach", 0, [])
        if i == 420:
            yield line("restore")
        if i == 500:
            yield line("despawn", 2)  # while it is grabbed
        yield line("step", DT, 0)


def laws():
    """A body under every law, each with a floor below it."""
    world = bare_world(floor=0.0)
    for number, law in enumerate(LAWS):
        place = (1.2 * number, 0.0, 0.7)
        world.add_body(
            sphere(radius=0.3, resolution=3), RUBBER, law=law, position=place, velocity=(0, 0, -1.0)
        )
    world.build()
    return world


def laws_game():
    for _ in range(STEPS):
        yield line("step", DT, 0)


def toys():
    """An artist's textured mesh on cages, which a kernel draws in every frame."""
    world = bare_world(soft_contact=True)
    cloth_of_toys = Material(young=3e4, poisson=0.4, density=200, damping_ratio=0.08)
    toy = SoftBodyAsset.from_surface(ASSETS / "elephant.glb", cloth_of_toys, cells=5, up="y")
    world.reserve(toy, 3)
    world.spawn(toy, position=(0.0, 0.0, 0.4), angular_velocity=(1.0, 0.0, 0.0))
    world.build()
    return world


def toys_game():
    for i in range(STEPS):
        if i in (60, 120):
            yield line("spawn", 0, (0.02, 0.0, 1.2), turn((0, 0, 1), i), (0.0, 0.0, 0.0), (0.0, 2.0, 0.0))
        yield line("step", DT, 0)
        if i % 100 == 0:
            yield line("mesh", 0, 0)


def tilted():
    """Bodies on a floor that is no collider, while the game tilts gravity and greases it."""
    world = bare_world(floor=0.0, gravity=(0.0, 0.0, -5.0))
    for i in range(3):
        world.add_body(box((0.4, 0.3, 0.2), (3, 2, 2)), RUBBER, position=(0.0, i, 0.15), velocity=(1.0, 0, 0))
    world.build()
    world.set_gravity((0.0, 0.5, -9.0))
    return world


def tilted_game():
    for i in range(STEPS):
        if i % 100 == 50:
            yield line("gravity", (4.0 * np.sin(0.01 * i), 1.0, -9.81))
        if i in (90, 300):
            yield line("floor_friction", 0.05 + 0.001 * i)
        if i == 120:
            yield line("snapshot")
        if i == 480:
            yield line("restore")
        yield line("step", DT, 0)


def joined():
    """Boxes that slide on each other, are joined and driven, while friction and gravity change."""
    world = bare_world(soft_contact=True, sleep_speed=0.3, collider_room=3)
    crate = SoftBodyAsset(box((0.4, 0.4, 0.3), (2, 2, 2)), RUBBER, contact=Contact(friction=0.2))
    bar = SoftBodyAsset(box((1.0, 0.2, 0.2), (5, 1, 1)), RUBBER)
    world.reserve(crate, 5)
    world.reserve(bar, 3)
    for i in range(4):
        world.spawn(crate, position=(0.05 * i, 0.6 * (i % 2), 0.2 + 0.35 * (i // 2)))
    for i in range(3):
        world.spawn(bar, position=(2.0 + 1.02 * i, 0.0, 0.4))
    world.add_collider(BoxShape((4.0, 0.2, 1.0)), position=(0.0, -0.6, 0.2), friction=0.9)
    world.build()
    world.bodies[2].set_friction(0.7)
    left, middle = world.bodies[4], world.bodies[5]
    middle.attach_to(left, ends_of(bar, -1), onto=ends_of(bar, 1))
    world.add_motor(left, ends_of(bar, -1), (1.0, 0.0, 0.0), speed=3.0, max_torque=20.0)
    return world


def ends_of(bar, side):
    """Vertices of the end of a bar on one side."""
    x = side * bar.mesh.vertices[:, 0]
    return np.flatnonzero(x > x.max() - 1e-6).tolist()


def joined_game():
    """Slots 0 and 1 lie on the floor, 2 and 3 on these, 5 to 7 are bars. Colliders: 0 a wall, 1 the floor.

    Joint 0 holds 6 to 5, motor 0 turns 5.
    """
    bar = SoftBodyAsset(box((1.0, 0.2, 0.2), (5, 1, 1)), RUBBER)
    near, far = ends_of(bar, -1), ends_of(bar, 1)
    up, along, still = (0.0, 0.0, 1.0), (1.0, 0.3, 0.0), (0.0, 0.0, 0.0)
    for i in range(STEPS):
        if i in (40, 260):
            yield line("gravity", (2.0 + 0.01 * i, -0.5, -9.81))
        if i in (100, 300):
            yield line("body_friction", 2, 0.05)
            yield line("body_friction", 0, 0.9)
            yield line("collider_friction", 0, 0.1)
        if i in (140, 310):
            yield line("floor_friction", 0.02 if i < 200 else 0.8)
            yield line("collider_friction", 1, 0.03 if i < 200 else 0.9)
        if i == 2:
            yield line("teleport", 7, (4.0, 0.0, 0.39), UPRIGHT, 0)
            yield line("join", 7, near, 6, [])  # at the position in the other body
            yield line("join", 3, [2, 0], 2, [5, 3])
        if i == 30:
            yield line("add_motor", 7, [*far, 0, 3, 7], 1, 0, 0, along, still, 6.0, 30.0)
            yield line("add_motor", 3, [4, 1, 9], 0, 1, 0, along, still, 0.5, 50.0)
            yield line("add_motor", 1, [8, 6, 2, 0], 1, 1, 1, up, (0.1, 0.6, 0.2), -4.0, 15.0)
        if i == 60:
            yield line("motor_speed", 0, -8.0)
            yield line("motor_limit", 1, 90.0)
            yield line("remove_motor", 2)
        if i == 80:
            yield line("release_joint", 0)
            yield line("add_motor", 0, [0, 5, 7], 0, 0, 0, up, still, 2.0, 20.0)
        if i == 120:
            yield line("snapshot")
        if i == 160:
            yield line("release_joint", 1)
            yield line("remove_motor", 0)
        if i == 200:
            yield line("restore")
        if i % 25 == 13 and 30 < i < 330:
            yield line("joint_force", 2)
            yield line("motor_state", 1)
            yield line("motor_state", 3)
        if i == 330:
            yield line("despawn", 2)  # with its joint to 3
            yield line("despawn", 7)  # with its joint and its motor
            yield line("spawn", 0, (0.3, 0.1, 0.9), UPRIGHT, still, (0.0, 0.0, 1.0))
        if i == 350:
            yield line("join", 2, [0, 1, 2], 3, [0, 1, 2])
            yield line("joint_force", 0)
        if i == 450:
            yield line("joint_force", 0)
        yield line("step", DT, 0)


def breaking():
    """Crates that hang from pinned crates by joints, with and without contact between bodies."""
    world = bare_world(soft_contact=True, floor=0.0, sleep_speed=0.02, collider_room=2)
    crate = SoftBodyAsset(box((0.4, 0.4, 0.4), (2, 2, 2)), RUBBER)
    world.reserve(crate, 8)
    for i in range(3):
        world.spawn(crate, position=(1.0 * i, 0.0, 2.0))
        world.spawn(crate, position=(1.0 * i, 0.0, 1.55))
    world.build()
    vertices = crate.mesh.vertices
    top, bottom = (np.flatnonzero(side * vertices[:, 2] > 0.19).tolist() for side in (1, -1))
    for i, limit in enumerate((900.0, None, 640.0)):
        upper, lower = world.bodies[2 * i], world.bodies[2 * i + 1]
        upper.pin(top)
        lower.attach_to(upper, top, onto=bottom, break_force=limit)
    return world


def breaking_game():
    """Joint 0 holds 900 N, joint 1 any force, joint 2 640 N; a crate weighs 628 N."""
    yield line("record_events", 255)
    for i in range(160):
        if i == 30:
            yield line("snapshot")
        if i in (40, 120):
            yield line("impulse", 1, (0.0, 0.0, -60.0), [])
        if i == 60:
            yield line("break_force", 1, 500.0)
        if i == 90:
            yield line("drain")
            yield line("restore")
        if i == 10:
            yield line("break_force", 1, 0.0)
        yield line("step", DT, 0)
        if i % 10 == 0:
            yield line("positions", 1, 1.0)
            yield line("positions", 3, 1.0)
    yield line("drain")


def shifted():
    """The world of `breaking`, with a lift, and a body on a frame."""
    world = breaking()
    crate = world.bodies[0].asset
    rider = world.spawn(crate, position=(4.0, 0.0, 1.2))
    frame = world.add_frame((4.0, 0.0, 1.5))
    rider.attach(ends_of_top(crate), frame, two_way=True)
    drive = dict(speed=2.0, max_torque=20.0, is_fixed=True, point=(4, 0.1, 0))
    world.add_motor(rider, [0, 2, 4, 6], (0, 0, 1), **drive)
    return world


def ends_of_top(asset):
    """Vertices of the top of an asset."""
    z = asset.mesh.vertices[:, 2]
    return np.flatnonzero(z > z.max() - 1e-6).tolist()


def shifted_game():
    """Shift the origin, while bodies hang, fall, are grabbed, and follow a frame and a collider."""
    origin = np.zeros(3)
    yield line("record_events", 128)
    yield line("break_attachment", 6, 0, 1e6)
    yield line("add_collider", 2, (0.6, 0.6, 0.2), 0.5, -1.0, 0.0, 1, 15, (4.0, 2.0, 0.5), UPRIGHT)
    yield line("spawn", 0, (4.0, 2.0, 0.9), UPRIGHT, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    for i in range(160):
        if i == 8:
            yield line("grab", 3, 5, (0.2, 0.5, 0.3), (1.0, 0.2, 1.2), 3.0, -1.0)
        if i in (20, 60, 100):
            offset = {20: (37.25, -12.5, 3.1), 60: (-1024.0, 0.0, 64.0), 100: (1000.0, 3.0, -60.0)}[i]
            origin = origin + offset
            yield line("shift_origin", offset)
            yield line("collider_pose", 0)
            yield line("collider_pose", 1)
        if i == 70:
            yield line("snapshot")
        if i == 120:
            yield line("restore")
            origin = np.array((37.25 - 1024.0, -12.5, 67.1))
        yield line("move_frame", 0, (4.0, 0.0, 1.5 + 0.004 * i) - origin, UPRIGHT)
        yield line("move_collider", 1, (4.0, 2.0, 0.5 + 0.005 * i) - origin, UPRIGHT)
        if i > 8:
            yield line("move_grab", 0, (1.0, 0.2, 1.2 + 0.002 * i) - origin)
        yield line("step", DT, 0)
        if i % 5 == 0:
            for slot in (1, 3, 6, 7):
                yield line("positions", slot, 1.0)
                yield line("positions", slot, 0.25)
            if i < 140:
                yield line("load", 6, 0)
        if i == 140:
            yield line("break_attachment", 6, 0, 300.0)
    yield line("drain")


def far_game():
    """The world of `shifted`, moved 20 km away: bodies hang, are spawned, thrown, grabbed, held and drawn.

    The origins are binary fractions, because Mono misreads some numbers of 17 digits.
    """
    origin = np.array((-20003.75, 5000.25, 0.0))
    still = (0.0, 0.0, 0.0)
    yield line("shift_origin", origin)
    yield line("record_events", 63)
    yield line("add_collider", 2, (0.6, 0.6, 0.2), 0.5, -1.0, 0.0, 1, 15, (4.0, 2.0, 0.5) - origin, UPRIGHT)
    yield line("spawn", 0, (4.01, 2.02, 0.9) - origin, turn((0, 0, 1), 0.3), still, (0.0, 1.0, 0.0))
    for i in range(160):
        if i == 8:
            yield line("grab", 3, 5, (0.2, 0.5, 0.3), (1.0, 0.2, 1.2) - origin, 3.0, -1.0)
        if i == 20:
            yield line("view_origin", (3.0, 1.0, 2.0) - origin)
            yield line("teleport", 5, (6.1, 0.2, 1.0) - origin, turn((1, 0, 1), 0.7), 0)
            yield line("velocity", 5, (30.0, 5.0, 4.0), (1.0, 2.0, 3.0))
        if i == 70:
            yield line("snapshot")
        if i == 90:
            yield line("shift_origin", (1000.25, 3.125, -0.5))
            origin = origin + np.array((1000.25, 3.125, -0.5))
        if i == 120:
            yield line("restore")
            origin = np.array((-20003.75, 5000.25, 0.0))
        if i == 140:
            yield line("view_origin", still)
        yield line("move_frame", 0, (4.0, 0.0, 1.5 + 0.004 * i) - origin, UPRIGHT)
        yield line("move_collider", 1, (4.0, 2.0, 0.5 + 0.005 * i) - origin, UPRIGHT)
        if i > 8:
            yield line("move_grab", 0, (1.0, 0.2, 1.2 + 0.002 * i) - origin)
        yield line("step", DT, 0)
        if i % 5 == 0:
            for slot in (1, 3, 5, 7):
                yield line("positions", slot, 1.0)
                yield line("positions", slot, 0.25)
                yield line("status", slot)
            yield line("load", 6, 0)
    yield line("drain")


def hulled():
    """Bodies that touch colliders, and no body, by a hull; what joints hold is stepped together."""
    world = bare_world(sleep_speed=0.2, collider_room=3)
    surface = sphere(radius=0.3, resolution=5)
    coarse = sphere(radius=0.32, resolution=2)
    ball = SoftBodyAsset(coarse, RUBBER, hull=(surface.vertices, surface.surface))
    crate = SoftBodyAsset(box((0.4, 0.4, 0.4), (2, 2, 2)), RUBBER)
    world.reserve(ball, 4)
    world.reserve(crate, 2)
    for i in range(3):
        world.spawn(ball, position=(0.8 * i, 0.0, 0.9 + 0.2 * i), angular_velocity=(0.0, 2.0 * i, 0.0))
    world.spawn(crate, position=(0.0, 1.0, 0.4))
    world.add_collider(BoxShape((1.0, 1.0, 0.3)), position=(0.3, 0.0, 0.2), rotation=turn((0, 1, 0), 0.2))
    world.build()
    return world


def hulled_game():
    """Slots 0 to 3 are balls, 4 and 5 crates. Colliders: 0 a ramp, 1 the floor."""
    still = (0.0, 0.0, 0.0)
    for i in range(STEPS):
        if i in (0, 200):
            yield line("record_events", 31)
        if i == 30:
            yield line("spawn", 0, (0.4, 0.1, 1.5), turn((1, 0, 1), 0.7), still, (1.0, 2.0, 3.0))
            yield line("snapshot")
        if i == 50:
            yield line("teleport", 4, (1.5, 0.0, 1.2), UPRIGHT, 0)
            yield line("velocity", 4, still, still)
        if i == 60:
            yield line("join", 4, [0, 1, 2], 2, [5, 6, 7])
            yield line("add_motor", 1, [0, 1, 2, 5], 1, 0, 0, (0.0, 1.0, 0.0), still, 9.0, 40.0)
        if 100 <= i < 200:
            yield line("move_collider", 0, (0.3, 0.0, 0.2 + 0.003 * (i - 100)), turn((0, 1, 0), 0.2))
        if i == 220:
            yield line("restore")
        if i == 300:
            yield line("join", 1, [0, 1], 4, [5, 6])
            yield line("impulse", 0, (3.0, 0.0, 30.0), [])
        if i == 380:
            yield line("despawn", 1)
        if i == 400:
            yield line("spawn", 0, (0.0, 0.0, 1.3), UPRIGHT, still, still)
            yield line("collider_friction", 1, 0.1)
        yield line("step", DT, 0)
        if i % 50 == 0:
            yield line("collider_impulse", 0)
            yield line("collider_impulse", 1)
            yield line("status", 0)
            yield line("positions", 2, 0.5)
            yield line("drain")


def rigid():
    """Rigid bodies in a heap, on a soft block, hung by joints from one that is pinned."""
    world = bare_world(soft_contact=True, sleep_speed=0.02, collider_room=3)
    crate = SoftBodyAsset.rigid(box((0.4, 0.3, 0.2), (1, 1, 1)), mass=3.0)
    ball = SoftBodyAsset.rigid(sphere(radius=0.2, resolution=2), density=500.0)
    block = SoftBodyAsset(box((0.8, 0.8, 0.3), (4, 4, 2)), RUBBER)
    world.reserve(crate, 6)
    world.reserve(ball, 2)
    world.reserve(block, 1)
    for i in range(4):
        world.spawn(crate, position=(0.02 * i, 0.0, 0.45 + 0.25 * i), rotation=turn((0, 0, 1), 0.3 * i))
    world.spawn(ball, position=(0.3, 0.1, 1.6), velocity=(-1.0, 0.0, 0.0))
    world.spawn(block, position=(0.0, 0.0, 0.16))
    world.add_collider(BoxShape((0.2, 2.0, 1.0)), position=(0.8, 0.0, 0.5))
    world.build()
    return world


def rigid_game():
    """Slots 0 to 5 are crates, 6 and 7 balls, 8 the block. Colliders: 0 a wall, 1 the floor."""
    still = (0.0, 0.0, 0.0)
    for i in range(STEPS):
        if i == 0:
            yield line("record_events", 31)
        if i == 20:
            yield line("spawn", 0, (-1.0, 0.0, 2.0), UPRIGHT, still, still)
            yield line("pin", 4, [0, 1, 2, 3])
            yield line("spawn", 0, (-1.0, 0.0, 1.7), UPRIGHT, still, (0.0, 0.0, 3.0))
            yield line("connect", 5, 4, 0, (-1.0, 0.0, 1.85), (0.0, 0.0, 1.0))
        if i == 60:
            yield line("spawn", 1, (-1.5, 0.0, 2.0), UPRIGHT, still, still)
            yield line("connect", 7, 4, 1, (-1.2, 0.0, 2.0), (0.1, 1.0, 0.0))
            yield line("impulse", 0, (20.0, 0.0, 3.0), [])
        if i == 120:
            yield line("grab", 1, 5, (0.2, 0.5, 0.3), (0.3, 0.3, 1.2), 3.0, -1.0)
            yield line("snapshot")
        if i == 150:
            yield line("move_grab", 0, (-0.3, 0.3, 1.0))
        if i == 180:
            yield line("release_joint", 1)
            yield line("connect", 7, 4, 2, (-1.2, 0.0, 2.0), (0.3, 1.0, -0.2))
            yield line("connect", 0, 8, 3, (0.0, 0.0, 0.2), (0.0, 0.0, 1.0))
        if i == 240:
            yield line("restore")
        if i == 300:
            yield line("joint_force", 0)
            yield line("release_joint", 0)
            yield line("teleport", 2, (0.3, 0.5, 1.4), turn((0, 1, 0), 0.7), 1)
        yield line("step", DT, 0)
        if i % 40 == 0:
            yield line("raycast", (0.05, 0.02, 5.0), (0.0, 0.0, -1.0), 10.0)
            yield line("closest", (0.1, 0.4, 0.9), 3.0)
            yield line("collider_impulse", 1)
            yield line("positions", 1, 0.5)
            yield line("mesh", 0, 0)
            yield line("drain")


def levels():
    """Bodies with levels of detail: balls with a skin and a hull, and bars."""
    world = bare_world(soft_contact=True, collider_room=2, sleep_speed=0.3)
    round_one = sphere(radius=0.25, resolution=6)
    ball = SoftBodyAsset.from_surface(
        (round_one.vertices, round_one.surface),
        RUBBER,
        cells=(6, 4, 3),
        hull=60,
        contact=Contact(thickness=0.005),
    )
    cells = ((8, 3, 2), (5, 2, 2), (3, 1, 1))
    finest, *coarser = (box((0.9, 0.3, 0.2), each) for each in cells)
    bar = SoftBodyAsset(finest, RUBBER).with_coarser(*coarser)
    ends = np.flatnonzero(finest.vertices[:, 0] == finest.vertices[:, 0].min())
    pinned = SoftBodyAsset(finest, RUBBER, pinned=ends).with_coarser(*coarser)
    for asset, count in ((ball, 3), (bar, 3), (pinned, 1)):
        world.reserve(asset, count)
    balls = [world.spawn(ball, position=(0.1 * i, 0.05 * i, 0.6 + 0.6 * i)) for i in range(2)]
    for i in range(2):
        world.spawn(bar, position=(1.6, 0.5 * i, 0.4 + 0.5 * i))
    world.spawn(pinned, position=(-1.2, 0.0, 1.0))
    world.add_collider(BoxShape((1.0, 1.0, 0.3)), position=(0.0, 0.0, 0.15))
    world.build()
    balls[1].set_level(1)
    return world


def levels_game():
    """Slots 0 to 2 are balls, 3 to 5 bars, 6 a pinned bar. Mesh 0 is of balls."""
    still = (0.0, 0.0, 0.0)
    rng = np.random.default_rng(3)
    now = {slot: 0 for slot in range(7)} | {1: 1}

    def change(slot, level, release=0):
        now[slot] = level
        yield line("set_level", slot, level, release)
        yield line("level", slot)

    def held_game(i):
        """What holds bodies passes on."""
        if i == 30:
            yield line("add_frame", (-0.5, 0.3, 1.0), turn((0, 0, 1), 0.3))
            yield line("add_frame", (2.1, 0.5, 1.0), UPRIGHT)
            yield line("attach", 6, [90, 91, 92, 94], 0, 1)  # near its free end
            yield line("attach", 4, [0, 1, 2, 3], 1, 1)
            yield line("attach", 4, [30, 40, 50], 1, 0)
        if 30 <= i < 300:
            yield line("move_frame", 0, (-0.5, 0.3 + 0.001 * (i - 30), 1.0), turn((0, 1, 2), 0.3 + 0.003 * i))
            yield line("move_frame", 1, (2.1, 0.5, 1.0 + 0.001 * i), turn((0, 1, 0), 0.002 * i))
        if i in (60, 110, 150, 210):
            yield from change(6, {60: 1, 110: 2, 150: 1, 210: 0}[i], 1)
            yield line("load", 6, 0) if i < 150 else line("status", 6)
        if i in (70, 100, 160):
            yield from change(4, {70: 2, 100: 1, 160: 0}[i], 1)
        if i == 120:
            yield line("pin", 6, [0, 8])
            yield line("targets", 6, [0, 8], ((-1.6, -0.2, 1.1), (-1.5, 0.1, 1.2)))
            yield from change(6, 0, 1)
            yield from change(6, 2, 1)
        if i == 310:
            yield line("detach", 4, [])
            yield line("unpin", 6, [])
        if i == 320:
            yield line("pin", 6, [5])  # a single vertex, which determines no rotation
            yield from change(6, 1)
            yield from change(6, 2)
            yield from change(6, 0)

    def grabbed_game(i):
        if i == 40:
            yield line("grab", 0, 3, (0.2, 0.5, 0.3), (0.2, 0.1, 0.9), 4.0, -1.0)
            yield line("grab", 0, 9, (1.0, 0.0, 0.0), (0.0, -0.3, 0.8), 7.0, 60.0)
            yield line("grab", 3, 5, (0.3, 0.3, 0.4), (1.6, 0.2, 0.9), 3.0, -1.0)
        if i in (50, 75, 105):
            yield from change(0, {50: 2, 75: 1, 105: 0}[i])
            yield from change(3, {50: 1, 75: 2, 105: 0}[i])
        if 40 < i < 130 and i % 10 == 0:
            for grab in range(3):
                yield line("grab_force", grab)
        if i == 130:
            for grab in range(3):
                yield line("release_grab", grab)

    for i in range(STEPS):
        yield from held_game(i)
        yield from grabbed_game(i)
        if i == 0:
            yield line("record_events", 31)
        if i == 10:
            yield line("force", 3, (100.0, 20.0, 60.0), [])
            yield line("velocity", 0, (0.5, 0.0, 1.0), (2.0, 3.0, 1.0))
            yield from change(0, 1)
            yield from change(3, 2)
        if i == 20:
            yield from change(1, 2)
            yield line("body_friction", 1, 0.8)
            yield from change(0, 0)
            yield from change(3, 0)
        if i == 140:
            yield from change(0, 2)
            yield line("despawn", 0)
            yield line("spawn", 0, (0.0, 0.0, 1.2), turn((1, 0, 1), 0.7), (0.5, 0.0, -1.0), (1.0, 2.0, 3.0))
            now[0] = 0
        if i == 170:
            yield from change(1, 1)
            yield line("snapshot")
        if i == 181:
            yield from change(1, 0)
            yield from change(6, 2, 1)
            yield line("despawn", 3)
        if i == 190:
            yield line("restore")
            now |= {1: 1, 3: 0, 6: 1}
        if i == 200:
            yield line("restore")
        if i == 220:
            yield line("join", 3, [1, 2, 4], 1, [3, 5, 6])
            yield line("add_motor", 3, [20, 21, 24, 25], 1, 0, 0, (1.0, 0.0, 0.0), still, 9.0, 20.0)
        if i == 260:
            yield from change(3, 1, 1)
        if i in (330, 420):
            yield line("wake")
            for slot in (0, 1):
                yield line("impulse", slot, (0.0, 3.0, 20.0), [0, 1, 2] if i == 330 else [])
        if i > 340 and i % 25 == 0:
            for slot in (0, 1, 3, 4):
                yield from change(slot, int(rng.integers(3)))
        if i == 500:
            yield from change(1, 2)
            yield line("despawn", 1)
            yield line("snapshot")
        if i == 510:
            yield line("spawn", 0, (0.4, 0.4, 1.5), UPRIGHT, still, still)
            now[1] = 0
        yield line("step", DT, 0)
        if i % 15 == 0:
            yield line("raycast", (rng.uniform(-1.5, 2), -4.0, rng.uniform(0, 1)), (0.0, 1.0, 0.02), 9.0)
            yield line("closest", rng.uniform(-1, 2, 3), 1.0)
            yield line("overlap_sphere", rng.uniform(0, 1.2, 3), 0.5)
            for slot in (0, 3, 4, 6):
                yield line("positions", slot, 0.25)
                yield line("positions", slot, 1.0)
                yield line("mesh", slot, {0: 0, 3: 1 + now[3], 4: 1 + now[4], 6: 4 + now[6]}[slot])
            yield line("drain")
            yield line("collider_impulse", 0)
    yield line("stable_substeps", DT)


def solved_levels():
    """Make bodies with levels of detail under implicit Euler, in a world without contact."""
    world = bare_world(floor=0.0, integrator="implicit_euler")
    finest, *coarser = (box((0.9, 0.3, 0.2), each) for each in ((8, 3, 2), (5, 2, 2), (3, 1, 1)))
    block = SoftBodyAsset(finest, RUBBER).with_coarser(*coarser)
    for i in range(2):
        world.reserve(block, 1)
        world.spawn(block, position=(0.0, 0.6 * i, 0.5 + 0.2 * i))
    world.build()
    return world


def solved_levels_game():
    for i in range(450):
        if i == 5:
            yield line("velocity", 0, (0.3, 0.0, 2.0), (3.0, 4.0, 0.0))
        if i == 20:
            yield line("grab", 1, 3, (0.2, 0.5, 0.3), (0.3, 0.8, 1.2), 3.0, -1.0)
        if i == 100:
            yield line("pin", 0, [0, 1])  # vertices on a line, which leave one rotation free
        if i % 30 == 10:
            yield line("set_level", 0, (i // 30) % 3, 0)
            yield line("set_level", 1, (i // 60) % 3, 0)
            yield line("positions", 0, 1.0)
        yield line("step", DT, 0)


def aimed():
    """Make a world with one collider of each shape, and bodies in two groups that move among them."""
    world = bare_world(floor=0.0, gravity=(0.0, 0.0, -3.0), collider_room=4)
    ball = SoftBodyAsset(sphere(radius=0.3, resolution=3), RUBBER, contact=Contact(group=2))
    brick = SoftBodyAsset(box((0.5, 0.4, 0.3), (3, 2, 2)), RUBBER)
    world.reserve(ball, 2)
    world.reserve(brick, 2)
    world.spawn(ball, position=(0.0, 0.0, 1.2), angular_velocity=(1.0, 0.0, 2.0))
    world.spawn(brick, position=(0.8, 0.0, 1.5), angular_velocity=(0.0, 3.0, 1.0))
    world.add_collider(BoxShape((0.6, 0.8, 0.4)), position=(0.0, 0.0, 0.4), rotation=turn((1, 1, 0), 0.3))
    world.add_collider(SphereShape(0.3), position=(1.0, 0.0, 0.5), group=4)
    world.add_collider(CapsuleShape(0.2, 0.5), position=(0.5, 0.8, 0.6), rotation=turn((1, 0, 0), 0.8))
    heights = 0.2 * np.sin(np.arange(35.0)).reshape(7, 5)
    world.add_collider(HeightFieldShape(heights, 0.3), position=(-1.2, 0.0, 0.4))
    corner = np.array([[i >> k & 1 for k in range(3)] for i in range(8)]) * (0.6, 0.5, 0.4)
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    faces = [(side[0], side[k], side[k + 1]) for side in sides for k in (1, 2)]
    world.add_collider(MeshShape((corner, faces), cell=0.07), position=(0.2, -1.0, 0.3))
    world.build()
    return world


def aimed_game():
    """Rays, casts and nearest points everywhere, while bodies and colliders move."""
    rng = np.random.default_rng(12)
    sizes = ((0.0, 0.0, 0.0), (0.15, 0.0, 0.0), (0.3, 0.2, 0.4), (0.1, 0.3, 0.0))
    yield line("drive_collider", 1, (0.0, -0.2, 0.1), (0.0, 1.0, 1.0))
    for i in range(60):
        if i == 20:
            yield line("teleport_collider", 2, (0.4, 0.7, 0.5), turn((1, 2, 0), 0.9))
        if i == 30:
            yield line("remove_collider", 0)
        if i == 40:
            yield line("add_collider", 2, (0.5, 0.5, 0.2), 0.5, -1.0, 0.0, 1, 15, (0.0, 0.0, 0.3), UPRIGHT)
        for _ in range(12):
            kind, target = rng.integers(0, 4), rng.uniform((-1.8, -1.2, 0.0), (1.2, 1.0, 1.0))
            start = target + rng.uniform((-1, -1, -0.2), (1, 1, 2))
            targets, mask = rng.choice([1, 2, 3, 3, 3]), rng.choice([-1, -1, 1, 6])
            pose = (*start, *turn(rng.normal(size=3), rng.uniform(0, 3)))
            reach = rng.choice([1.0, 50.0])
            yield line("cast", kind, sizes[kind], pose, target - start, reach, targets, mask)
            yield line("nearest", start, reach, targets, mask)
        yield line("step", DT, 0)


def thesis_sphere():
    """The world whose step docs/native.md measures."""
    world = bare_world(floor=0.0)
    material = Material(young=2e5, poisson=0.3, density=1000, damping=200.0)
    world.add_body(load_mesh(ASSETS / "sphere.npz"), material, position=(0.0, 0.0, 3.0))
    world.build()
    return world


def surfaces():
    """Bodies on conveyors, a belt that is tilted and the floor, within sensors."""
    world = bare_world(soft_contact=True, sleep_speed=0.1, collider_room=4)
    crate = SoftBodyAsset(box((0.3, 0.3, 0.3), (2, 2, 2)), RUBBER)
    world.reserve(crate, 4)
    for i in range(3):
        world.spawn(crate, position=(0.02 * i, 0.05 * i, 0.5 + 0.35 * i))
    world.add_collider(
        BoxShape((3.0, 1.0, 0.2)),
        position=(0.0, 0.0, 0.1),
        rotation=turn((0, 1, 0), -0.1),
        friction=0.6,
        surface_velocity=(0.5, 0.1, 0.0),
    )
    world.add_sensor(BoxShape((0.4, 2.0, 2.0)), position=(0.6, 0.0, 0.5), rotation=turn((0, 0, 1), 0.2))
    world.build()
    return world


def surfaces_game():
    """Slots 0 to 2 lie on the belt, collider 0, which carries them through the sensor, collider 1, to the
    floor, collider 2.
    """
    still = (0.0, 0.0, 0.0)
    for i in range(STEPS):
        if i in (0, 450, 520):
            yield line("record_events", {0: 127, 450: 32, 520: 127}[i])
        if i == 60:
            for kind, size in enumerate(((1, 1, 1), (0.2, 0, 0), (0.4, 0.3, 0.9), (0.1, 0.5, 0))):
                place = (0.3 * kind, 0.1, 0.4 - 0.6 * (kind == 0)), turn((1, 0, 0), 0.2 * kind)
                yield line("add_sensor", kind, size, 1, 15, *place)
        if i in (90, 480):
            yield line("drive_collider", 3, (0.0, 0.0, 0.2), (0.0, 0.0, 1.0))
            yield line("move_collider", 4, (0.5, 0.2, 0.4), turn((1, 1, 0), 0.5))
        if i == 130:
            yield line("remove_collider", 5)
            yield line("teleport_collider", 6, (-0.5, 0.0, 0.5), turn((0, 1, 0), 1.0))
        if i in (100, 160):
            yield line("body_filter", 0, 1, 6 if i == 100 else 15)  # falls through the belt and the others
            yield line("collider_filter", 1, 1 if i == 100 else 2, 15)
        if i in (320, 350):
            yield line("collider_filter", 0, 1, 0 if i == 320 else 15)
            yield line("body_filter", 1, 2, 15)
        if i in (170, 260, 440, 470):
            yield line("enabled", 1, int(i in (260, 470)))
        if i == 175:
            yield line("join", 1, [0, 1, 2], 0, [6, 7, 8])
        if i == 180:
            yield line("despawn", 2)
        if i == 220:
            yield line("spawn", 0, (0.5, 0.0, 0.9), UPRIGHT, still, (0.0, 2.0, 0.0))
        if i in (120, 300, 400):
            yield line("surface_velocity", 0, {120: (-0.8, 0.0, 3.0), 300: (1.5, 0.2, 0.0), 400: still}[i])
        if i in (150, 500):
            yield line("surface_velocity", 2, (0.0, 0.4, 0.0) if i == 150 else still)
        if i == 200:
            yield line("snapshot")
        if i == 340:
            yield line("restore")
        yield line("step", DT, 0)
        if i % 50 == 0:
            for number in (0, 2):
                yield line("collider_impulse", number)
            for number in (1, 3) if i < 100 else (1, 6):
                yield line("bodies_inside", number) if i > 60 else line("drain")
            yield line("drain")
            for slot in range(2):
                yield line("status", slot)
                yield line("positions", slot, 1.0)


GAMES = {
    "toys": (toys, toys_game),
    "heap": (heap, heap_game),
    "free": (free, free_game),
    "drape": (drape, drape_game),
    "shells": (shells, shells_game),
    "rods": (rods, rods_game),
    "held": (held, held_game),
    "laws": (laws, laws_game),
    "tilted": (tilted, tilted_game),
    "joined": (joined, joined_game),
    "hulled": (hulled, hulled_game),
    "rigid": (rigid, rigid_game),
    "levels": (levels, levels_game),
    "solved_levels": (solved_levels, solved_levels_game),
    "surfaces": (surfaces, surfaces_game),
}
