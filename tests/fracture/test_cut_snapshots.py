"""Snapshots of cut or torn bodies, restored in the same world, in another world, and over a rewind."""

import json
from dataclasses import replace

import numpy as np
import pytest

from engine_adapter import Rollback
from taichi_soft import Material, Plasticity, SnapshotError, SoftBodyAsset, Tearing, box
from taichi_soft.core.container import seal, unseal
from taichi_soft.persistence.snapshot import MARK, VERSION
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT, SUBSTEPS = 1 / 60, 12
BAR, SLAB = box((1.6, 0.4, 0.4), (8, 2, 2)), box((0.2, 0.8, 1.2), (1, 4, 6))
FIRST, SECOND = ((0.03, 0.0, 0.0), (1.0, 0.1, 0.3)), ((0.03, 0.0, 0.0), (0.2, 1.0, 0.1))


def make_world(**options):
    """A bar that can be cut and keeps dents, a slab that hangs and tears where it is pulled, and room."""
    material = Material(1e5 * np.linspace(0.8, 1.2, len(BAR.tets)), 0.3, 1000.0, 20.0)
    bar = SoftBodyAsset(
        BAR, material, spare_vertices=80, plasticity=Plasticity(yield_strain=0.05), pinned=[0, 1]
    )
    weak = Material(8e4, 0.3, 600.0, 20.0)
    slab = SoftBodyAsset(
        SLAB,
        weak,
        pinned=np.flatnonzero(SLAB.vertices[:, 2] > 0.59),
        spare_vertices=40,
        tearing=Tearing(2.5e4),
    )
    world = bare_world(**options)
    world.reserve(bar, 6)
    world.reserve(slab, 3)
    world.build()
    world.spawn(bar, position=(0.0, 0.0, 0.8))
    world.spawn(slab, position=(0.0, 3.0, 1.5))
    return world


@pytest.fixture(scope="module")
def worlds(tmp_path_factory):
    """Return two equal worlds, one of which records, and their initial state."""
    folder = tmp_path_factory.mktemp("records")
    played, fresh = make_world(record=5, record_to=folder / "frozen.recording"), make_world()
    return played, fresh, played.snapshot()


@pytest.fixture
def played(worlds):
    worlds[0].restore(worlds[2])
    return worlds[0]


@pytest.fixture
def fresh(worlds):
    worlds[1].restore(worlds[2])
    return worlds[1]


def run(world, steps=6):
    """Return the hash of the state after each step."""
    names = []
    for _ in range(steps):
        world.step(DT, SUBSTEPS)
        names.append(world.state_hash())
    return names


def bar_of(world):
    return world.bodies[0]


def cut_open(body):
    """Cut the bar from above to its middle."""
    low, high = body.aabb()
    x, _, z = (low + high) / 2
    body.cut(triangle=[[x, -1.0, z], [x, 1.0, z], [x, 0.0, 9.0]])


def cut_twice(world):
    """Cut the bar in two and the larger part open, with steps between."""
    run(world, 3)
    bar_of(world).cut(plane=FIRST)
    run(world, 3)
    cut_open(bar_of(world))
    run(world, 3)


def meshes(world):
    """Return the data that a renderer and a game read from all bodies."""
    return [
        tuple(
            rows.tobytes()
            for rows in (
                each.tets, each.surface, each.mesh.vertices, each.masses, each.pinned, each.positions(),
                each.velocities(), each.vertex_origins, each.tet_origins, each.tet_stress(),
            )
        )
        for each in world.bodies
    ]  # fmt: skip


def go_on(world):
    """Make steps, a cut across the earlier cuts, a change of material, and more steps."""
    names = run(world)
    count = len(world.bodies)
    bar_of(world).cut(plane=SECOND)
    assert len(world.bodies) > count
    names += run(world)
    bar_of(world).set_damping(5.0)
    world.bodies[-1].apply_impulse((3.0, 0.0, 1.0))
    return names + run(world)


def test_a_cut_body_comes_back_whole_in_every_respect(played):
    cut_twice(played)
    data, seen, name = played.snapshot(), meshes(played), played.state_hash()
    then = go_on(played)
    played.restore(data)
    assert meshes(played) == seen
    assert played.state_hash() == name
    assert played.snapshot() == data
    assert go_on(played) == then


@pytest.mark.guard
def test_a_world_that_never_saw_the_cuts_goes_on_from_them_bit_by_bit(played, fresh):
    cut_twice(played)
    played.bodies[-1].set_material(Material(2e5, 0.1, 700.0, 9.0))
    data = played.snapshot()
    fresh.restore(data)
    assert meshes(fresh) == meshes(played)
    assert fresh.snapshot() == data
    assert go_on(fresh) == go_on(played)


def test_a_whole_world_comes_back_after_cuts(played, worlds):
    first = bar_of(played)
    expected = run(played)
    played.restore(worlds[2])
    cut_twice(played)
    fallen = played.bodies[1]
    played.restore(worlds[2])
    assert (first.is_cut, first.vertex_count, fallen.is_alive) == (False, len(BAR.vertices), False)
    assert run(played) == expected


def test_the_topology_version_goes_on_where_the_mesh_changes_and_only_there(played, worlds):
    body = bar_of(played)
    body.cut(plane=FIRST)
    data, version = played.snapshot(), body.topology_version
    run(played, 2)
    played.restore(data)
    assert body.topology_version == version  # the mesh has not changed
    cut_open(body)
    later = body.topology_version
    played.restore(data)
    assert body.topology_version > later > version  # a number is never reused for another mesh
    played.restore(worlds[2])
    assert body.topology_version > later + 1


def test_handles_of_pieces_live_and_die_with_the_state(played):
    body = bar_of(played)
    before = played.snapshot()
    (fallen,) = body.cut(plane=FIRST)
    after, rows = played.snapshot(), fallen.positions()
    played.restore(before)
    assert not fallen.is_alive
    played.restore(after)
    assert fallen.is_alive
    assert fallen in played.bodies
    assert (fallen.positions() == rows).all()
    played.despawn(fallen)
    empty = played.snapshot()
    played.spawn(body.asset, position=(0, -2, 1))
    expected = run(played)
    played.restore(empty)
    played.spawn(body.asset, position=(0, -2, 1))
    assert run(played) == expected


def test_what_tears_by_itself_tears_on_in_the_same_way(played, fresh):
    slab = played.bodies[1]
    slab.apply_impulse((0.0, 0.0, -700.0), np.flatnonzero(SLAB.vertices[:, 2] < -0.5))
    for _ in range(100):
        played.step(DT, SUBSTEPS)
        if slab.is_cut:
            break
    data, torn = played.snapshot(), slab.topology_version
    expected = run(played, 30)
    assert slab.topology_version > torn
    fresh.restore(data)
    assert run(fresh, 30) == expected


def test_a_body_without_room_for_tears_has_none_after_a_restore(played, fresh):
    tears = played._built.tears
    slab = played.bodies[1]
    tears.stop(slab)
    slab.apply_impulse((0.0, 0.0, -700.0), np.flatnonzero(SLAB.vertices[:, 2] < -0.5))
    fresh.restore(played.snapshot())
    assert run(fresh, 12) == run(played, 12)
    assert not slab.is_cut
    assert not fresh.bodies[1].is_cut


def test_a_rewind_over_cuts_makes_the_same_again(played):
    rollback = Rollback(played, 12)

    def play(begin, end, *, late):
        for step in range(begin, end):
            rollback.save()
            if step == 3:
                bar_of(played).cut(plane=FIRST)
            if step == 6 and late:
                cut_open(bar_of(played))
            played.step(DT, SUBSTEPS)
        return played.state_hash()

    start = played.step_count
    straight = play(0, 10, late=True)
    rollback.rewind_to(start)
    guessed = play(0, 10, late=False)
    rollback.rewind_to(start + 5)
    assert bar_of(played).is_cut
    assert play(5, 10, late=True) == straight != guessed


def test_a_record_is_kept_of_what_happens_to_cut_bodies(played, tmp_path):
    cut_twice(played)
    cut_open(played.bodies[1])
    run(played, 3)
    report = replay(played.save_recording(tmp_path / "cut.recording"))
    assert report.first_difference is None
    assert 5 <= report.steps < 11
    assert report.world.state_hash() == played.state_hash()
    assert bar_of(report.world).is_cut


def _note(world, row, to):
    def change(notes, words):
        notes["bodies"][0][4][row] = to
        return words

    return change


def _word(at, to):
    """One word of the part's rows, counted from behind."""

    def change(notes, words):
        words[at] = to(words[at]) if callable(to) else to
        return words

    return change


def _swap(notes, words):
    """Swap two corners of the last tetrahedron."""
    words[[-1, -2]] = words[[-2, -1]]
    return words


def _nothing(notes, words):
    notes["bodies"][0][4] = None
    return words


FORGED = {
    "another vertex": _word(-1, lambda x: x ^ 1),
    "a vertex beyond": _word(-1, 10**6),
    "below zero": _word(-3, -1),
    "corners exchanged": _swap,
    "one word less": lambda notes, words: words[:-1],
    "one word more": lambda notes, words: np.append(words, 0),
    "another count": _note(None, 0, 7),
    "a negative count": _note(None, 1, -3),
    "a huge count": _note(None, 1, 10**12),
    "text": _note(None, 0, "many"),
    "another name": _note(None, 2, "0" * 16),
    "no part": _nothing,
}


@pytest.mark.parametrize("name", FORGED)
def test_a_damaged_part_is_refused_before_anything_changes(played, name):
    bar_of(played).cut(plane=FIRST)
    fallen = played.bodies[1]
    played.despawn(fallen)
    structure, notes, words, memory = unseal(played.snapshot(), MARK, VERSION, "snapshot")
    content, rows = json.loads(bytes(notes)), np.frombuffer(words, "<i4").copy()
    rows = FORGED[name](content, rows)
    data = seal(
        MARK, VERSION, [bytes(structure), json.dumps(content).encode(), rows.tobytes(), bytes(memory)]
    )
    before, seen = played.state_hash(), meshes(played)
    with pytest.raises(SnapshotError, match="snapshot is invalid"):
        played.restore(data)
    assert played.state_hash() == before
    assert meshes(played) == seen


def test_a_slot_that_a_cut_body_left_holds_the_same_new_body_before_and_after_a_restore(played):
    """Its vibrations fade as those of its asset, though the snapshot has what another material left there."""
    bar = played.bodies[0]
    bar.cut(plane=FIRST)
    bar.set_material(replace(bar.material, damping_ratio=0.6))
    for body in [body for body in played.bodies if body.asset is bar.asset]:
        played.despawn(body)
    left = played.snapshot()

    def spawned():
        body = played.spawn(bar.asset, position=(0.0, 0.0, 0.8))
        played.apply_radial_impulse((0.3, 0.0, 0.8), 20.0, 0.5)
        for _ in range(20):
            played.step(DT, SUBSTEPS)
        return body.positions()

    before = spawned()
    played.restore(left)
    assert (spawned() == before).all()
