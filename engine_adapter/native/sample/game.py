"""World of the sample: balls fall onto a lift. Export it with `taichi-soft export game.py --out
game.softworld`.
"""

from taichi_soft import BoxShape, Material, SoftBodyAsset, World, sphere

world = World()
rubber = Material(young=6e4, poisson=0.4, density=1000, damping_ratio=0.1)
ball = SoftBodyAsset(sphere(radius=0.3, resolution=4), rubber)
world.reserve(ball, 6)
first = world.spawn(ball, position=(0.0, 0.0, 1.5))
lift = world.add_collider(BoxShape((2.0, 2.0, 0.2)), position=(0.0, 0.0, 0.1))
world.build()
