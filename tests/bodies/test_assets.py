"""Assets that bodies of one kind share: created once, immutable, and checked before a body uses them."""

import numpy as np
import pytest

from taichi_soft import (
    Material,
    MaterialError,
    MeshError,
    OptionError,
    SoftBodyAsset,
    box,
)
from taichi_soft.bodies.layout import arrange
from taichi_soft.world.bare import bare_world

JELLY = Material(1e5, 0.2, 1000.0, 20.0)
MESH = box(cells=(2, 2, 2))


def cube(**options):
    return SoftBodyAsset(MESH, JELLY, **options)


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 2, 2), (3, 4, 5)])
def test_blocks_hold_every_edge_once_and_each_half_of_one_first_end(cells):
    mesh = box(cells=cells)
    world = bare_world(floor=None)
    arrays = world.add_body(mesh, JELLY).asset.arrays
    held = []
    for first, count in arrays.edge_blocks:
        rows = range(first, first + count)
        assert 1 <= count <= 8
        for half in (rows[:4], rows[4:]):
            assert len({int(arrays.edge_vertices[row, 0]) for row in half}) <= 1
        held += rows
    assert held == list(range(len(mesh.edges)))
    pairs = np.sort(arrays.order[arrays.edge_vertices], axis=1)
    assert {tuple(pair) for pair in pairs.tolist()} == {tuple(sorted(pair)) for pair in mesh.edges.tolist()}


def test_blocks_of_edges_are_nearly_full():
    """The fill level is measured for particles with about nine edges each."""
    arrays = bare_world(floor=None).add_body(box(cells=(5, 5, 5)), JELLY).asset.arrays
    assert arrays.edge_blocks[:, 1].mean() > 0.85 * 8


def test_copies_are_arranged_once(monkeypatch):
    made = []

    def counted(description):
        made.append(description)
        return arrange(description)

    monkeypatch.setattr("taichi_soft.bodies.asset.arrange", counted)
    world, kind = bare_world(floor=None), cube()
    for x in range(4):
        world.add_body(MESH, JELLY, position=(3 * x, 0, 0))
    assert len(made) == 1
    world.add_body(MESH, JELLY, pinned=[0])
    world.add_body(MESH, JELLY, law="face")
    assert len(made) == 3
    for other in (world, bare_world(floor=None)):
        other.reserve(kind, 5)
    assert len(made) == 4
    assert len({body.asset for body in world.bodies}) == 3


def test_an_asset_cannot_be_changed_through_anything_it_shares():
    pinned = np.array([4, 2, 2])
    asset = cube(pinned=pinned)
    pinned[:] = 0
    assert asset.pinned.tolist() == [2, 4]
    body = bare_world(floor=None).add_body(MESH, JELLY)
    for name in ("mesh", "law", "pinned", "description"):
        with pytest.raises(AttributeError):
            setattr(asset, name, None)
    for rows in (asset.pinned, body.masses, body.mesh.vertices):
        with pytest.raises(ValueError, match="read-only"):
            rows[...] = 0


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"mesh": None}, MeshError),
        ({"mesh": MESH.scaled(1e-9)}, MeshError),
        ({"material": 5}, MaterialError),
        ({"law": "hope"}, OptionError),
        ({"law": "neo_hookean", "flips": "off"}, OptionError),
        ({"strain": 3}, OptionError),
        ({"damping_model": None}, OptionError),
        ({"pinned": [27]}, OptionError),
        ({"pinned": [0.5]}, OptionError),
    ],
)
def test_what_makes_no_body_makes_no_asset(change, error):
    options = {"mesh": MESH, "material": JELLY, **change}
    mesh, material = options.pop("mesh"), options.pop("material")
    with pytest.raises(error):
        SoftBodyAsset(mesh, material, **options)
