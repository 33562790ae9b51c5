"""Two machines play one game. Each receives the other's inputs late, rewinds and repeats the steps.

Each side of the image shows one machine. After a key press, the two sides differ for a few frames and then
agree again.
"""

from dataclasses import dataclass, field

import numpy as np

from engine_adapter import FixedStep, Rollback
from taichi_soft import BoxShape, Contact, Material, World, box, sphere
from taichi_soft.cli import main
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.props import Prop

MATERIAL = Material(young=2.5e4, poisson=0.3, density=300.0, damping_ratio=0.1)
CONTACT = Contact(friction=0.3)
ROOM, WALL, HEIGHT = 4.0, 0.12, 0.5  # width of the arena, thickness and height of its walls [m]
BESIDE = np.array([ROOM + 0.9, 0.0, 0.0])  # offset of the second machine's view [m]
LATE = 8  # latency of an input to the other machine [ticks]
PUSH, JUMP = 0.75 * GRAVITY_EARTH, 1.6  # acceleration of a pressed key [m/s^2], speed of a jump [m/s]
STEP = FixedStep(dt=1 / 50, substeps=16)

Keys = tuple[float, float, float]
"""Input of a player in a tick: direction (x, y), and 1 to jump, else 0."""


def make_world() -> World:
    """Make an arena with the two players' bodies and four free bodies."""
    world = World(friction=0.3)
    reach = (ROOM + WALL) / 2
    for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        size = (WALL if x else ROOM + 2 * WALL, WALL if y else ROOM, HEIGHT)
        world.add_collider(BoxShape(size), position=(x * reach, y * reach, HEIGHT / 2))
    cube, ball = box((0.7, 0.7, 0.7), (3, 3, 3)), sphere(0.25, 2)
    for x in (-1.2, 1.2):
        world.add_body(cube, MATERIAL, position=(x, 0.0, 0.352), contact=CONTACT)
    for x, y in ((0.0, 1.0), (0.0, -1.0), (0.1, 0.1), (-0.4, 1.5)):
        world.add_body(ball, MATERIAL, position=(x, y, 0.252), contact=CONTACT)
    world.build()
    for body in world.bodies:
        body.set_linear_damping(0.5)
    return world


@dataclass
class Machine:
    """One player's machine: its world, the known inputs, and predictions of unknown inputs."""

    player: int
    world: World
    known: dict[tuple[int, int], Keys] = field(default_factory=dict)  # known inputs, by tick and player
    used: dict[int, tuple[Keys, Keys]] = field(default_factory=dict)  # inputs that each tick used
    names: dict[int, str] = field(default_factory=dict)  # state hash before each tick
    rewinds: int = 0
    wrong: int = 0  # number of repeated ticks that began in a different state than before

    def __post_init__(self) -> None:
        self.rollback = Rollback(self.world, LATE + 1)

    def press(self) -> None:
        """Choose the player's input for this tick: chase another body, and jump occasionally."""
        tick, me = self.world.step_count, self.player
        x, y, _ = self._keys(tick, me)
        if tick % (17 + 6 * me) == 0:
            turn = tick // (17 + 6 * me)
            goal = (
                1 if me == 0 and turn % 3 else 2 + turn % 4
            )  # sometimes the other player, sometimes a free body
            way = (self.world.bodies[goal].center_of_mass() - self.world.bodies[me].center_of_mass())[:2]
            x, y = (way / max(float(np.linalg.norm(way)), 1e-3)).tolist()
        self.known[tick, me] = (x, y, float(tick % (61 + 12 * me) == 40))

    def receive(self, tick: int, keys: Keys) -> None:
        """Receive the other player's input for a tick. If it was not predicted, repeat from that tick on."""
        self.known[tick, 1 - self.player] = keys
        if self.used[tick][1 - self.player] == keys:
            return
        now = self.world.step_count
        self.rollback.rewind_to(tick)
        self.rewinds += 1
        while self.world.step_count < now:
            self.begin_tick()
            self.world.step(STEP.dt, STEP.substeps)

    def begin_tick(self) -> None:
        """Save the state, and apply both players' inputs."""
        tick = self.world.step_count
        self.rollback.save()
        name = self.world.state_hash()
        self.wrong += self.names.get(tick, name) != name
        self.names[tick] = name
        self.used[tick] = (self._keys(tick, 0), self._keys(tick, 1))
        for body, (x, y, jumps) in zip(self.world.bodies, self.used[tick], strict=False):
            mass = float(body.masses.sum())
            body.apply_force((mass * PUSH * x, mass * PUSH * y, 0.0))
            if jumps:
                body.apply_impulse((0.0, 0.0, mass * JUMP))

    def _keys(self, tick: int, player: int) -> Keys:
        """Return the known input of a player, or predict that the player repeats the last direction."""
        if (tick, player) in self.known:
            return self.known[tick, player]
        x, y, _ = self.known.get((tick - 1, player)) or self.used.get(tick - 1, (_NONE, _NONE))[player]
        return x, y, 0.0


_NONE: Keys = (0.0, 0.0, 0.0)


class Match:
    """Two machines and the slow connection between them."""

    def __init__(self, worlds: tuple[World, World]) -> None:
        """Start before the first tick."""
        self.machines = [Machine(player, world) for player, world in enumerate(worlds)]

    def __call__(self, world: World) -> None:
        """Run a tick of both machines, except for the step of the first world. The caller makes that step
        next.
        """
        tick = world.step_count
        for machine in self.machines:
            if tick >= LATE:
                other = self.machines[1 - machine.player]
                machine.receive(tick - LATE, other.known[tick - LATE, other.player])
            machine.press()
            machine.begin_tick()
        second = self.machines[1].world
        second.step(STEP.dt, STEP.substeps)

    def settled(self) -> list[int]:
        """List the ticks for which both machines know all inputs."""
        return sorted(self.machines[0].names)[: -LATE or None]

    def agreed(self) -> int:
        """Return the number of settled ticks that both machines began in bit-identical states."""
        first, second = (machine.names for machine in self.machines)
        return sum(first[tick] == second[tick] for tick in self.settled())

    def caption(self) -> str:
        """Return the latency, the rollbacks and the agreement as text for a frame."""
        rewinds = sum(machine.rewinds for machine in self.machines)
        agreed = f"{self.agreed()} of {len(self.settled())} hashes agree"
        return f"inputs {LATE} ticks late, {rewinds} rollbacks, {agreed}"


def stage() -> Stage:
    """Make the stage: the worlds of both machines, side by side."""
    first, second = make_world(), make_world()
    match = Match((first, second))
    colors = [PALETTE[0], PALETTE[1], *[PALETTE[2]] * 4]
    actors = [Actor(body, color) for body, color in zip(first.bodies, colors, strict=True)]
    actors += [
        Actor(body, color, world=second, shift=BESIDE)
        for body, color in zip(second.bodies, colors, strict=True)
    ]
    walls = [each for each in second.colliders if each is not second.floor_collider]
    props = [Prop((wall.shape.surface()[0] + BESIDE, wall.shape.surface()[1]), wall) for wall in walls]
    camera = Camera.framing(
        (-2.1, -2.1, 0.0), (BESIDE[0] + 2.1, 2.1, 0.8), aspect=16 / 9, azimuth=-90, elevation=48, margin=1.0
    )
    title = "one game on two machines"
    return Stage(title, first, actors, camera, STEP, 10.0, act=match, props=props, caption=match.caption)


def proof(stage: Stage) -> float:
    """Return the fraction of settled ticks that both machines began in the same state; 0 without a
    rollback.
    """
    match = stage.act
    assert isinstance(match, Match)
    if not all(machine.rewinds and machine.wrong for machine in match.machines):
        return 0.0
    return match.agreed() / len(match.settled())


if __name__ == "__main__":
    main("demo", "rollback")
