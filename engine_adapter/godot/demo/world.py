"""World of the Godot demo: toy elephants, and a soft block under a crate. See docs/godot.md.

    taichi-soft export world.py --axes y-up --out demo.softworld

In Python z is up. In Godot y is up, and -z corresponds to y in Python. Ground, platform and crate are nodes
of Godot.
"""

from pathlib import Path

from taichi_soft import Contact, Material, SoftBodyAsset, World, box

TOY = Path(__file__).with_name("elephant.glb")  # a copy of assets/elephant.glb

world = World(floor=None, sleep_speed=0.05, collider_room=8)
plush = Material(young=3e4, poisson=0.4, density=200, damping_ratio=0.1)
elephant = SoftBodyAsset.from_surface(
    TOY, plush, cells=5, up="y", contact=Contact(friction=0.9, thickness=0.005)
)
world.reserve(elephant, 3)
rider = world.spawn(elephant, position=(-1.5, 0.0, 0.61))
cushion = Material(young=3e5, poisson=0.3, density=1000, damping_ratio=0.2)
bearing = Contact(faces=False)  # so that a light crate of Godot can lie on it: see docs/coupling.md
block = world.add_body(box((1, 1, 0.5), (6, 6, 3)), cushion, position=(1.5, 0.0, 0.26), contact=bearing)
world.build()
