"""World of the network sample: two players push soft cubes over a stage that they can raise."""

from taichi_soft import BoxShape, Contact, Material, World, box, sphere

ROOM, WALL = 4.0, 0.2  # width of the arena and thickness of its walls [m]

world = World(friction=0.3)
rubber = Material(young=2.5e4, poisson=0.3, density=300, damping_ratio=0.1)
cube, ball, grip = box((0.6, 0.6, 0.6), (2, 2, 2)), sphere(radius=0.25, resolution=2), Contact(friction=0.3)
players = [world.add_body(cube, rubber, position=(x, 0.0, 0.4), contact=grip) for x in (-1.2, 1.2)]
balls = [world.add_body(ball, rubber, position=(0.1, y, 0.4), contact=grip) for y in (-1.0, 1.0)]
stage = world.add_collider(BoxShape((1.2, 1.2, 0.1)), position=(0.0, 0.0, 0.0))
for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1)):
    size = (WALL if x else ROOM, WALL if y else ROOM, 1.5)
    world.add_collider(BoxShape(size), position=(x * (ROOM + WALL) / 2, y * (ROOM + WALL) / 2, 0.75))
world.build()
for body in world.bodies:
    body.set_linear_damping(0.5)
