"""World of the sample: a jelly, and balls that fall onto it.

taichi-soft export game.py --out game.softworld --axes y-up --for web
"""

from taichi_soft import Contact, Material, SoftBodyAsset, World, box, sphere

world = World(floor=0.0)
gum = Material(young=4e4, poisson=0.4, density=1000, damping_ratio=0.1)
jelly = world.add_body(
    box(size=(1.0, 1.0, 0.8), cells=(5, 5, 4)), gum, position=(0, 0, 0.4), contact=Contact(friction=0.6)
)
ball = SoftBodyAsset(sphere(radius=0.25, resolution=4), gum)
world.reserve(ball, 4)
world.build()
