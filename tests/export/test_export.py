"""Exports that are refused, with the reason; a refused export leaves no files."""

import numpy as np
import pytest

from taichi_soft import Event, Material, OptionError, SoftBodyAsset, StateError, box, sphere
from taichi_soft.export import AXES, export_world
from taichi_soft.export.archive import written
from taichi_soft.world.bare import bare_world

JELLY = Material(young=5e4, poisson=0.4, density=1000, damping_ratio=0.1)
BALL = SoftBodyAsset(sphere(radius=0.3, resolution=2), JELLY)


def cut():
    world = bare_world()
    world.add_body(box((1, 1, 1), (2, 2, 2)), JELLY, spare_vertices=20, position=(0, 0, 1))
    return world


def plain():
    world = bare_world()
    world.add_body(BALL, position=(0, 0, 1))
    return world


def recording():
    world = plain()
    world.build()
    world.record_events([Event])
    return world


def watching():
    world = plain()
    world.build()
    world.bodies[0].watch_stress(1e4)
    return world


def forced():
    world = plain()
    world.build()
    world.set_force_field(lambda positions, time: np.zeros_like(positions))
    return world


def changed():
    world = plain()
    world.build()
    world.bodies[0].set_material(Material(young=1e4, poisson=0.4, density=1000, damping_ratio=0.1))
    return world


def skipping():
    world = plain()
    world.build()
    world.skip_step([world.bodies[0]])
    return world


def flat():
    world = bare_world(schedule="flat")
    world.add_body(BALL, position=(0, 0, 1))
    return world


@pytest.mark.parametrize(
    ("make", "what", "why", "way_out"),
    [
        (cut, "asset 0 can be cut or torn", "needs Python", "leave out spare_vertices"),
        (recording, "it records events", "runs in Python", "ts_world_record_events"),
        (
            watching,
            "watches stress",
            "runs in Python",
            "leave out record_events, on and watches",
        ),
        (forced, "it has a force field", "the library cannot call", "set_force_field(None)"),
        (
            changed,
            "body 0 was given another material",
            "uses the material of its asset",
            "make the asset with that material",
        ),
        (skipping, "body 0 skips the next step", "only Python", "call World.step"),
        (flat, "schedule 'flat'", "does not support the contact", "schedule='per_body'"),
    ],
)
def test_a_refused_export_says_what_why_and_what_to_do_instead(make, what, why, way_out, tmp_path):
    world = make()
    if not world.is_built:
        world.build()
    with pytest.raises(OptionError) as refused:
        export_world(world, tmp_path / "game.softworld")
    for words in (what, why, way_out):
        assert words in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_world_that_is_not_built_wrong_axes_an_unknown_platform_and_a_path_that_is_taken_are_refused(
    tmp_path,
):
    with pytest.raises(StateError, match="not built"):
        export_world(plain(), tmp_path / "a")
    with pytest.raises(OptionError, match=r"platform amiga.*linux-x64"):
        export_world(plain(), tmp_path / "a", platforms=["amiga"])
    world = plain()
    world.build()
    with pytest.raises(OptionError, match="axes must be one of"):
        export_world(world, tmp_path / "a", axes="left")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "letter.txt").write_text("keep me")
    with pytest.raises(OptionError, match="not a world file"):
        export_world(world, tmp_path / "a")
    (tmp_path / "file").write_text("keep me")
    with pytest.raises(OptionError, match="cannot write"):
        export_world(world, tmp_path / "file" / "b")
    assert (tmp_path / "a" / "letter.txt").read_text() == "keep me"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a", "file"]


def test_axes_of_engines_turn_up_to_where_it_is_there():
    ups = {name: np.array(rows) @ (0, 0, 1) for name, rows in AXES.items()}
    np.testing.assert_array_equal(
        [ups[name] for name in ("z-up", "y-up", "unity", "unreal")],
        [(0, 0, 1), (0, 1, 0), (0, 1, 0), (0, 0, 100)],
    )
    signs = {name: np.sign(np.linalg.det(rows)) for name, rows in AXES.items()}
    assert signs == {"z-up": 1, "y-up": 1, "unity": -1, "unreal": -1}  # left-handed ones turn the other way


def test_entries_lie_at_multiples_of_8_bytes_so_that_they_are_read_where_they_lie():
    rows = np.arange(6, dtype=np.float64).reshape(2, 3)
    whole = written({"a": np.array([1, 2, 3], dtype=np.int32), "longer name": rows})
    assert whole[:8] == b"TSOFTWLD"
    assert len(whole) % 8 == 0
    assert whole.index(rows.tobytes()) % 8 == 0
