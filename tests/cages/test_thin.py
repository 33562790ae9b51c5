"""Limbs and sheets thinner than the cells: smaller cells preserve them, or a warning reports the loss."""

import logging

import numpy as np
import pytest
import trimesh
from surfaces import ball, joined, with_triangles

from taichi_soft import Material, OptionError, SoftBodyAsset, element_model, stable_step
from taichi_soft.cages import build_cage, tetrahedra_of
from taichi_soft.cages.marking import part_count
from taichi_soft.meshing.surfaces import read_surfaces
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.numpy

RUBBER = Material(young=1e6, poisson=0.3, density=1000.0)
TOP = (2.0, 1.2, 0.25)
FEET = [(x, y) for x in (-0.85, 0.85) for y in (-0.5, 0.5)]


def block(size, at):
    return trimesh.creation.box(size).apply_translation(at)


def table(thickness):
    """Make a table whose four legs reach from z = 0 into its top."""
    legs = [block((thickness, thickness, 1.0), (x, y, 0.5)) for x, y in FEET]
    return joined(block(TOP, (0, 0, 1.0)), *legs)


def table_moments(thickness):
    """Return volume, centre and inertia about the centre, from boxes. Legs count only below the top."""
    boxes = [(TOP, (0, 0, 1.0)), *(((thickness, thickness, 0.875), (x, y, 0.4375)) for x, y in FEET)]
    volumes = np.array([np.prod(size) for size, _ in boxes])
    places = np.array([at for _, at in boxes])
    center = volumes @ places / volumes.sum()
    inertia = np.zeros((3, 3))
    for volume, (size, at) in zip(volumes, boxes, strict=True):
        arm, squares = np.array(at) - center, np.array(size) ** 2
        inertia += volume * (
            np.diag(squares.sum() - squares) / 12 + arm @ arm * np.eye(3) - np.outer(arm, arm)
        )
    return volumes.sum(), center, inertia


def cage(mesh, **options):
    return build_cage(read_surfaces(mesh), **options)


CELL = 2.0 / 6
LEG = 0.01  # m, a 33rd of a cell


@pytest.fixture(scope="module")
def kept():
    return cage(table(LEG), cells=6)


def test_legs_of_a_33rd_of_a_cell_are_kept_with_their_whole_length(kept):
    legs = kept.mesh.vertices[kept.mesh.vertices[:, 2] < 0.6]
    assert part_count(kept.mesh.tets) == 1
    for foot in FEET:
        mine = np.abs(legs[:, :2] - foot).max(axis=1) < CELL / 2
        assert legs[mine, 2].min() < 0.25 * CELL
        heights = np.sort(legs[mine, 2])
        assert np.diff(heights).max() < CELL  # no gap
    assert np.isfinite(kept.thin.kept)
    assert not np.isfinite(kept.thin.lost)
    assert kept.thin.kept == pytest.approx(LEG, rel=0.1)


def test_cells_are_halved_once_and_only_at_the_legs(kept):
    at = kept.mesh.vertices[kept.mesh.tets].mean(axis=1)
    away = np.abs(at[:, None, :2] - np.array(FEET)).max(axis=2).min(axis=1)
    assert kept.octave.max() == 1
    assert away[kept.octave > 0].max() < 2.5 * CELL
    assert (kept.octave[at[:, 2] < 0.6] == 1).all()


def test_refined_tetrahedra_are_as_good_as_others(kept):
    quality = kept.mesh.quality
    assert quality.min_dihedral.min() >= 10.0
    assert quality.max_dihedral.max() <= 160.0


def test_mass_and_centre_are_those_of_the_solid_to_one_per_cent_and_inertia_to_two(kept):
    """The vertices of legs cannot be light enough for an exact inertia."""
    volume, center, inertia = table_moments(LEG)
    weights, places = kept.mesh.vertex_volumes, kept.mesh.vertices
    found = weights @ places / weights.sum()
    arms = places - found
    second = np.einsum("k,ki,kj->ij", weights, arms, arms)
    assert weights.min() > 0.0
    assert weights.sum() == pytest.approx(volume, rel=0.01)
    np.testing.assert_allclose(found, center, atol=0.01 * 2.0)
    turning = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(np.linalg.eigvalsh(turning), np.linalg.eigvalsh(inertia), rtol=0.02)


def test_the_stable_step_is_at_least_0_2_of_the_lattices(kept):
    """The limit is half of the value for a limb that needs no smaller cells."""
    limit = stable_step(kept.mesh, RUBBER, element_model("virial")).limit
    assert limit > 0.2 * 0.33 * CELL / np.sqrt(1e6 / 1000.0)


def test_without_refinement_they_are_left_out_and_their_thickness_is_told():
    found = cage(table(LEG), cells=6, refine=0)
    assert found.mesh.vertices[:, 2].min() > 0.6
    assert not np.isfinite(found.thin.kept)
    assert found.thin.lost == pytest.approx(LEG, rel=0.1)


@pytest.mark.soak
def test_the_cell_size_that_is_named_keeps_them_without_refinement():
    small = block((0.6, 0.4, 0.2), (0, 0, 0.6))
    legs = [block((0.006, 0.006, 0.6), (x, y, 0.3)) for x in (-0.2, 0.2) for y in (-0.1, 0.1)]
    surfaces = read_surfaces(joined(small, *legs))
    (words,) = tetrahedra_of(surfaces, cells=3, refine=0).notes
    assert "left out" in words
    named = float(words.split("cell_size=")[1].split()[0])
    found = build_cage(surfaces, cell_size=named, refine=0)
    assert found.thin is None
    assert part_count(found.mesh.tets) == 1
    assert found.mesh.vertices[:, 2].min() < 0.03


@pytest.mark.soak
def test_the_octaves_that_are_named_keep_what_one_does_not():
    thin = table(0.006)
    once = tetrahedra_of(read_surfaces(thin), cells=6)
    assert once.mesh.vertices[:, 2].min() > 0.6
    assert "refine=2" in once.notes[0]
    twice = cage(thin, cells=6, refine=2)
    assert twice.octave.max() == 2
    assert twice.mesh.vertices[:, 2].min() < 0.1


def test_what_is_thinner_than_any_refinement_is_left_out_and_told():
    made = tetrahedra_of(read_surfaces(table(0.0005)), cells=6, refine=3)
    assert made.mesh.vertices[:, 2].min() > 0.6
    (words,) = made.notes
    assert "left out" in words
    assert "refine=" not in words


def test_legs_that_voxels_tear_off_stay_on():
    """The legs are 1/17 of a cell thick.

    Between voxels, their upper ends would be lost, and the top would fall.
    """
    found = cage(table(0.02), cells=6)
    assert found.part.max() == 0
    assert part_count(found.mesh.tets) == 1
    assert found.mesh.vertices[:, 2].min() < 0.1


def test_a_thin_sheet_that_grows_from_a_body_is_kept():
    fin = block((1.0, 0.002, 1.6), (1.2, 0.1, 0.0))  # a 230th of a cell
    body = joined(ball(), fin)
    assert cage(body, cells=6, refine=0).mesh.vertices[:, 0].max() < 1.3
    found = cage(body, cells=6)
    assert found.mesh.vertices[:, 0].max() > 1.6
    assert part_count(found.mesh.tets) == 1


@pytest.mark.parametrize(
    "mesh",
    [
        pytest.param(ball(), marks=pytest.mark.soak),
        trimesh.creation.box((4.0, 1.0, 1.0)),
        trimesh.creation.box((1.0, 1.0, 0.02)),
        pytest.param(
            joined(ball(0.5), with_triangles(ball(0.8), [[0, 1, 2], [0, 2, 1]])), marks=pytest.mark.soak
        ),
    ],
    ids=["ball", "box", "sheet", "a wall without thickness"],
)
def test_what_needs_no_refinement_is_the_same_with_it(mesh):
    plain, refined = (cage(mesh, cells=8, refine=octaves) for octaves in (0, 3))
    assert plain.thin is None
    assert refined.thin is None
    for name in ("vertices", "tets", "fill", "vertex_volumes"):
        assert getattr(plain.mesh, name).tobytes() == getattr(refined.mesh, name).tobytes()


def test_the_same_surface_gives_the_same_refined_cage(kept):
    again = cage(table(LEG), cells=6)
    for name in ("vertices", "tets", "fill", "vertex_volumes"):
        assert getattr(kept.mesh, name).tobytes() == getattr(again.mesh, name).tobytes()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"refine": -1}, "refine"),
        ({"refine": 4}, "refine"),
        ({"refine": 1.5}, "refine"),
        ({"refine": 1, "method": "tetgen"}, "refine=1.*leave it out"),
    ],
)
def test_a_bad_refinement_is_refused(options, text):
    with pytest.raises(OptionError, match=text):
        SoftBodyAsset.from_surface(ball(), RUBBER, **options)


def test_what_was_refined_is_logged(caplog):
    with caplog.at_level(logging.WARNING, logger="taichi_soft"):
        SoftBodyAsset.from_surface(table(LEG), RUBBER, cells=6)
    assert "too thin for cells of 0.333 m" in caplog.text
    assert "refine=0" in caplog.text


@pytest.mark.soak
def test_a_table_on_thin_legs_stands_on_them():
    """The table is light and stiff enough, because legs are as stiff as the cells that contain them."""
    light = Material(young=1e8, poisson=0.3, density=100.0, damping_ratio=0.3)
    asset = SoftBodyAsset.from_surface(table(LEG), light, cells=6)
    world = bare_world()
    body = world.add_body(asset, position=(0.0, 0.0, 0.01 - asset.mesh.vertices[:, 2].min()))
    world.build()
    for _ in range(60):
        world.step(1 / 60)
    now = body.positions()
    assert not body.is_frozen
    assert body.flipped_count() == 0
    assert now[:, 2].max() > 1.0  # of 1.125: the top is up
    assert now[:, 2].min() == pytest.approx(0.0, abs=0.03)
