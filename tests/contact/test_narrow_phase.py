"""Selection of contacts from candidates, with a vertex in front of triangles at chosen positions."""

import numpy as np
import pytest

from taichi_soft import Contact, Material, TetMesh, box
from taichi_soft.contact.fields import SLOTS
from taichi_soft.contact.kernels.narrow_phase import find_contacts
from taichi_soft.core.runtime import ti
from taichi_soft.solver.state import State
from taichi_soft.world.bare import bare_world

SOFT = Material(young=2e5, poisson=0.3, density=1000.0, damping=60.0)
THICKNESS = 0.02
BODY = 3  # slot of the vertex's body; the triangles belong to the bodies before it


@ti.kernel
def find(state: ti.template(), body: ti.i32):
    ti.loop_config(serialize=True)
    for _ in range(1):
        find_contacts(state, body, 0.0, 1 / 600)


class Candidates:
    """A vertex and a triangle of each of three other bodies, all of them candidates of contact."""

    def __init__(self) -> None:
        world = bare_world(floor=None, gravity=(0, 0, 0), soft_contact=True)
        for i in range(BODY + 1):
            contact = Contact(thickness=THICKNESS)
            world.add_body(box((0.1,) * 3, (2, 2, 2)), SOFT, position=(0.3 * i, 0, 0), contact=contact)
        world.build()
        self.world, self.state = world, world._built.state
        assert isinstance(self.state, State)
        state = self.state
        for field in (state.islands.is_exploding, state.soft.particle_gone, state.particle_speed):
            field.fill(0)  # a step writes them first; here they may be of the last world of this size
        outer = self.state.body_outer.to_numpy()[BODY][0]
        self.feature = outer + self.state.soft.body_edges[BODY][0]
        self.first, self.vertex = self.feature * SLOTS, self.state.outer_particle[outer]

    def place(self, vertex, triangles) -> None:
        """Put the vertex and the triangles, (3, 3) [m] each, where they are wanted."""
        x, soft = self.state.particle_position.to_numpy(), self.state.soft
        x[self.vertex] = vertex
        for row, corners in enumerate(triangles):
            triangle = self.state.body_triangles.to_numpy()[row][0]
            who = self.state.triangle_vertices.to_numpy()[triangle]
            x[who] = corners
            soft.slot_points[self.first + row] = [self.vertex, *who]
            soft.slot_feature[self.first + row] = self.feature
            soft.slot_partner[self.first + row] = triangle
            soft.slot_spare[self.first + row] = -1.0  # near in any case
        self.state.particle_position.from_numpy(x)
        soft.slot_count[BODY] = soft.vertex_slot_count[BODY] = len(triangles)

    def bear(self, row: int, normal_impulse: float, friction_impulse) -> None:
        """Make one the only contact there was, with these impulses [N s]."""
        soft = self.state.soft
        for other in range(3):
            soft.slot_normal_impulse[self.first + other] = normal_impulse if other == row else 0.0
            soft.slot_friction_impulse[self.first + other] = friction_impulse if other == row else [0.0] * 3
        soft.contact_count[BODY], soft.contact_slot[self.first] = 1, self.first + row

    def contacts(self) -> list[int]:
        find(self.state, BODY)
        count = self.state.soft.contact_count[BODY]
        return [self.state.soft.contact_slot[self.first + k] - self.first for k in range(count)]

    def normal_impulse(self) -> list[float]:
        return [self.state.soft.slot_normal_impulse[self.first + row] for row in range(3)]

    def friction_impulse(self) -> list[list[float]]:
        return [list(self.state.soft.slot_friction_impulse[self.first + row]) for row in range(3)]


@pytest.fixture(scope="module")
def candidates():
    return Candidates()


def level(z):
    return np.array([[-0.1, -0.1, z], [0.1, -0.1, z], [0.0, 0.1, z]])


def test_none_but_the_contacts_keep_an_impulse(candidates):
    """The vertex is behind two triangles and in front of one.

    Its impulse goes to the nearer of the two triangles, or is lost if this triangle pushes in another
    direction.
    """
    candidates.place((0, 0, 0), [level(0.02), level(-0.001), level(0.01)])
    candidates.bear(1, 5.0, [1.0, 2.0, 0.0])
    assert candidates.contacts() == [2]
    assert candidates.normal_impulse() == [0.0, 0.0, 5.0]
    assert candidates.friction_impulse() == [[0.0] * 3, [0.0] * 3, [1.0, 2.0, 0.0]]
    wall = level(0.01)[:, [2, 0, 1]]
    candidates.place((0, 0, 0), [level(0.02), level(-0.001), wall])
    candidates.bear(1, 5.0, [1.0, 2.0, 0.0])
    assert candidates.contacts() == [2]
    assert candidates.normal_impulse() == [0.0] * 3
    assert candidates.friction_impulse() == [[0.0] * 3] * 3


@pytest.mark.parametrize("bears", [0, 1])
def test_in_front_of_an_edge_the_triangle_that_bears_goes_on_whatever_rounding_says(candidates, bears):
    """Both sides of a roof are as near, and each shares out friction to other corners."""
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    ridge = np.array([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]])
    roof = [
        np.array([ridge[0], ridge[1], [-0.1, 0.0, -0.08]]),
        np.array([ridge[1], ridge[0], [0.1, 0.0, -0.08]]),
    ]
    rng = np.random.default_rng(1)
    for _ in range(40):
        vertex = np.array([0.0, 0.01, 0.98 * THICKNESS]) + rng.uniform(-1, 1, 3) * [1e-3, 1e-3, 1e-4]
        away = rng.uniform(-1, 1, 3)  # elsewhere in the world numbers are rounded in another way
        candidates.place(turn @ vertex + away, [corners @ turn.T + away for corners in roof])
        candidates.bear(bears, 2.0, [0.1, 0.0, 0.0])
        assert candidates.contacts() == [bears]
        assert candidates.normal_impulse()[bears] == 2.0


def test_on_a_flat_surface_the_nearest_triangle_bears_however_it_was_before(candidates):
    left = np.array([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0], [-0.1, 0.0, 0.0]])
    right = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.1, 0.0, 0.0]])
    for side in (-1.0, 1.0):
        candidates.place((side * 1e-3, 0.0, 0.98 * THICKNESS), [left, right])
        for bears in (0, 1):
            candidates.bear(bears, 2.0, [0.1, 0.0, 0.0])
            over = int(side > 0.0)
            assert candidates.contacts() == [over]
            assert candidates.normal_impulse()[over] == 2.0
            assert candidates.friction_impulse()[over] == pytest.approx([0.1, 0.0, 0.0])


@pytest.mark.soak
def test_a_tip_in_a_valley_rests_on_both_its_sides():
    """Pressed into a groove of 15 degrees it lies still: one side at a time would throw it to the other."""
    groove = box((1, 1, 0.5), (4, 4, 2))
    v = groove.vertices.copy()
    v[v[:, 2] > 0.2, 2] += 0.27 * np.abs(v[v[:, 2] > 0.2, 0])
    bar = box((0.2, 0.2, 0.4), (2, 2, 4))
    x = bar.vertices.copy()
    tip = int(np.flatnonzero((x[:, 2] < -0.15) & (np.abs(x[:, :2]).max(axis=1) < 0.01))[0])
    x[tip, 2] -= 0.1
    firm = Material(young=3e5, poisson=0.3, density=500.0, damping=40.0)
    contact = Contact(friction=0.3, thickness=THICKNESS)
    world = bare_world(floor=None, soft_contact=True)
    world.add_body(
        TetMesh(v, groove.tets),
        firm,
        pinned=np.flatnonzero(v[:, 2] < -0.2),
        contact=contact,
        law="neo_hookean",
    )
    pressed = world.add_body(
        TetMesh(x, bar.tets), firm, position=(0, 0.113, 0.55), contact=contact, law="neo_hookean"
    )
    world.build()
    pressed.pin(np.flatnonzero(x[:, 2] > 0.15))
    for _ in range(400):
        world.step(1 / 60)
    for _ in range(30):
        world.step(1 / 60)
        assert np.linalg.norm(pressed.velocities(), axis=1).max() < 1e-3  # [m/s]; by one side it was 7e-3
    assert abs(pressed.positions()[tip][0]) < 0.1 * THICKNESS  # friction holds it there
