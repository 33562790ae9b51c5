"""Cages of good tetrahedra: mass, inertia, bending and vibration equal those of the enclosed solid."""

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
import trimesh
from surfaces import ball, joined, turned

from taichi_soft import (
    CageMesh,
    Material,
    MeshError,
    OptionError,
    SoftBodyAsset,
    TetMesh,
    element_model,
    stable_step,
)
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.sag import sag
from taichi_soft.cages import build_cage
from taichi_soft.meshing.surfaces import read_surfaces

pytestmark = pytest.mark.numpy

RUBBER = Material(young=1e6, poisson=0.3, density=1000.0)
LATTICE_STEP = 0.33
"""Stable step of a lattice that fills space, in the time that sqrt(E / density) takes for a cell."""


def cage(mesh, **options):
    return build_cage(read_surfaces(mesh), **options)


SOLIDS = {
    "ball": ball(),
    "box": trimesh.creation.box((4.0, 1.0, 1.0)),
    "turned box": turned(trimesh.creation.box((4.0, 1.0, 1.0))),
    "torus": turned(trimesh.creation.torus(1.0, 0.3)),
    "thin ring": turned(trimesh.creation.torus(1.0, 0.06)),
    "sheet": turned(trimesh.creation.box((1.0, 1.0, 0.02))),
    "capsule": turned(trimesh.creation.capsule(3.0, 0.3)),
    "tube": turned(trimesh.creation.annulus(0.5, 1.0, 0.3)),
}


SOAKS = ("turned box", "capsule", "tube")


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=pytest.mark.soak if name in SOAKS else ()) for name in SOLIDS],
)
def made(request):
    mesh = SOLIDS[request.param]
    return mesh, cage(mesh, cells=12)


def test_every_tetrahedron_is_well_shaped(made):
    quality = made[1].mesh.quality
    assert quality.min_dihedral.min() >= 10.0
    assert quality.max_dihedral.max() <= 160.0


def test_mass_centre_and_inertia_are_those_of_the_solid_to_one_per_cent(made):
    """The reference is the divergence theorem over the surface of the solid, computed by trimesh."""
    mesh, found = made
    weights, places = found.mesh.vertex_volumes, found.mesh.vertices
    center = weights @ places / weights.sum()
    arms = places - center
    second = np.einsum("k,ki,kj->ij", weights, arms, arms)
    inertia = np.trace(second) * np.eye(3) - second
    assert weights.min() > 0.0
    assert weights.sum() == pytest.approx(mesh.volume, rel=0.01)
    np.testing.assert_allclose(center, mesh.center_mass, atol=0.01 * np.ptp(mesh.vertices, axis=0).max())
    # Vertices beside a sheet of a quarter of a cell cannot be as light as they would have to be.
    close = 0.02 if np.ptp(mesh.vertices, axis=0).min() < 0.7 and mesh.volume < 0.03 else 0.01
    np.testing.assert_allclose(
        np.linalg.eigvalsh(inertia), np.linalg.eigvalsh(mesh.moment_inertia), rtol=close
    )


def test_the_stable_step_is_at_least_0_45_of_the_lattices(made):
    found = made[1].mesh
    cell = np.ptp(made[0].vertices, axis=0).max() / 12
    limit = stable_step(found, RUBBER, element_model("virial")).limit
    assert limit > 0.45 * LATTICE_STEP * cell / np.sqrt(1e6 / 1000.0)


def test_it_hangs_together_as_the_solid_does(made):
    owner = np.arange(len(made[1].mesh.vertices))
    for _ in range(len(owner)):  # the smallest number spreads over each tetrahedron
        least = owner[made[1].mesh.tets].min(axis=1)
        before = owner.copy()
        np.minimum.at(owner, made[1].mesh.tets.ravel(), np.repeat(least, 4))
        if (owner == before).all():
            break
    assert len(np.unique(owner)) == 1


def eigenproblem(mesh):
    """Return K and M of K u = w^2 M u for a free body with constant strain in each tetrahedron."""
    body = BodyDescription(mesh, RUBBER, element_model("virial"))
    corners = mesh.vertices[mesh.tets]
    inverse = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
    slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    strain = np.zeros((len(slopes), 6, 12))
    for c in range(4):
        x, y, z = slopes[:, c].T
        at = 3 * c
        strain[:, 0, at], strain[:, 1, at + 1], strain[:, 2, at + 2] = x, y, z
        strain[:, 3, at + 1], strain[:, 3, at + 2] = z, y
        strain[:, 4, at], strain[:, 4, at + 2] = z, x
        strain[:, 5, at], strain[:, 5, at + 1] = y, x
    lame, mu = 1e6 * 0.3 / (1.3 * 0.4), 1e6 / 2.6
    hooke = np.diag([2 * mu] * 3 + [mu] * 3) + lame * np.outer([1, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0])
    weights = (mesh.volumes * mesh.fill)[:, None, None]
    blocks = np.swapaxes(strain, 1, 2) @ (weights * (hooke @ strain))
    rows = (3 * mesh.tets[:, :, None] + np.arange(3)).reshape(-1, 12)
    pairs = np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel()
    size = 3 * len(mesh.vertices)
    stiffness = scipy.sparse.coo_matrix((blocks.ravel(), pairs), (size, size)).tocsc()
    return stiffness, scipy.sparse.diags(np.repeat(body.masses, 3)).tocsc()


def lowest_bending(mesh):
    """Return the angular frequency of the slowest vibration of a free body [rad/s]."""
    stiffness, mass = eigenproblem(mesh)
    start = np.random.default_rng(0).normal(size=mass.shape[0])
    squares = scipy.sparse.linalg.eigsh(
        stiffness, 8, mass, sigma=-1.0, which="LM", v0=start, return_eigenvectors=False
    )
    return np.sqrt(np.sort(squares)[6])  # six rigid motions come before


def test_the_stable_step_is_just_below_two_over_the_highest_frequency(made):
    """Vertices carry more or less than a quarter of the adjacent mass. Light vertices vibrate fast."""
    stiffness, mass = eigenproblem(made[1].mesh)
    scale = scipy.sparse.diags(1.0 / np.sqrt(mass.diagonal()))
    start = np.random.default_rng(0).normal(size=mass.shape[0])
    (square,) = scipy.sparse.linalg.eigsh(
        scale @ stiffness @ scale, 1, which="LA", v0=start, return_eigenvectors=False
    )
    limit = stable_step(made[1].mesh, RUBBER, element_model("virial")).limit
    assert 0.85 < limit / (2.0 / np.sqrt(square)) <= 1.0


@pytest.mark.soak
def test_a_bar_along_no_axis_bends_as_a_beam_and_the_better_the_finer():
    """Compare the slowest bending with that of a free beam.

    The angular frequency is w = (4.730 / L)^2 sqrt(EI / rho A) (Weaver, Timoshenko and Young, "Vibration
    problems in engineering", art. 5.12). Rotation and shear reduce it by the factor 1 + (4.730 r / L)^2 / 2
    times (1.006 + 2.974 E / kG), with r^2 = I / A and k = 10 (1 + nu) / (12 + 11 nu).
    """
    length, nu = 8.0, 0.3
    bar = turned(trimesh.creation.box((length, 1.0, 1.0)))
    slender = (4.730 / length) ** 2 * np.sqrt(1e6 / 1000.0 / 12.0)
    shear = 2 * (1 + nu) * (12 + 11 * nu) / (10 * (1 + nu))
    exact = slender / (1 + 0.5 * (4.730 / length) ** 2 / 12.0 * 0.55 * (1.0 + shear))
    found = {n: lowest_bending(cage(bar, cell_size=1.0 / n).mesh) for n in (2, 3, 4)}
    errors = {n: abs((w / exact) ** 2 - 1) for n, w in found.items()}
    assert errors[4] < 0.15
    assert errors[4] < errors[3] < errors[2]


@pytest.mark.soak
def test_parts_that_do_not_touch_stay_apart():
    gap = 0.02  # m, a tenth of a cell
    found = cage(joined(ball(), ball(at=(2.0 + gap, 0.0, 0.0))), cell_size=0.2)
    first, second = (np.unique(found.mesh.tets[found.part == part]) for part in (0, 1))
    assert len(np.intersect1d(first, second)) == 0
    assert len(first) + len(second) == len(found.mesh.vertices)


def test_parts_that_overlap_are_one():
    assert cage(joined(ball(), ball(at=(1.5, 0.0, 0.0))), cells=12).part.max() == 0


def test_a_limb_thinner_than_a_cell_is_kept():
    limb = trimesh.creation.capsule(1.5, 0.06).apply_translation((0, 0, 0.8))
    found = cage(joined(ball(), limb), cells=10).mesh  # cells of 0.26 m; the limb ends at 1.61 m
    assert found.vertices[:, 2].max() > 1.55
    outside = found.vertices[:, 2] > 1.15
    assert found.vertex_volumes[outside].sum() == pytest.approx(np.pi * 0.06**2 * 0.46, rel=0.5)


def test_every_vertex_on_the_surface_of_a_ball_is_on_the_ball():
    found = cage(ball(subdivisions=5), cells=10).mesh
    distance = np.abs(np.linalg.norm(found.vertices[found.surface_vertices], axis=1) - 1.0)
    assert np.quantile(distance, 0.9) < 0.025  # of cells of 0.2
    assert distance.max() < 0.08


def test_the_same_surface_gives_the_same_cage():
    first, second = (cage(SOLIDS["torus"], cells=8).mesh for _ in range(2))
    for name in ("vertices", "tets", "fill", "vertex_volumes"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes()


@pytest.mark.parametrize(
    ("source", "options", "error", "text"),
    [
        (ball(), {"cells": 1000}, OptionError, "GiB"),
        (ball(), {"cells": 0}, OptionError, "cells"),
        (ball(), {"cells": 5, "cell_size": 0.1}, OptionError, "one of them"),
        (ball(), {"cell_size": 9.0}, OptionError, "cell_size=9 m.*reduce it"),
        (([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), {}, MeshError, "thickness"),
        (([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]]), {}, MeshError, "no volume"),
        (([[1, 1, 1]] * 3, [[0, 1, 2]]), {}, MeshError, "a point"),
        (([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]), {}, MeshError, "no area"),
        (trimesh.creation.box((1.0, 0.001, 0.001)), {"cells": 1}, OptionError, "Take cell_size"),
    ],
)
def test_what_makes_no_cage_is_refused_with_the_way_out(source, options, error, text):
    with pytest.raises(error, match=text):
        cage(source, **options)


def test_a_cage_mesh_checks_what_it_carries():
    tet = np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]]
    for fill, volumes, text in (
        ([0.0], [1.0] * 4, "above 0"),
        ([1.0, 1.0], [1.0] * 4, "one for each"),
        ([1.0], [1.0, np.nan, 1.0, 1.0], "finite"),
    ):
        with pytest.raises(MeshError, match=text):
            CageMesh(*tet, fill, volumes)


def test_a_scaled_and_turned_cage_carries_the_same_solid():
    found = cage(ball(), cells=4).mesh
    moved = found.scaled(2.0).rotated([0.0, 0.0, 1.0, 0.0]).translated((1.0, 0.0, 0.0))
    assert isinstance(moved, CageMesh)
    assert moved.vertex_volumes == pytest.approx(8.0 * found.vertex_volumes)
    assert moved.fill.tolist() == found.fill.tolist()


def test_half_full_tetrahedra_weigh_and_stiffen_by_half():
    whole = TetMesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]])
    half = CageMesh(whole.vertices, whole.tets, [0.5], whole.vertex_volumes / 2)
    full_body, half_body = (BodyDescription(m, RUBBER, element_model("virial")) for m in (whole, half))
    assert half_body.masses == pytest.approx(0.5 * full_body.masses)
    np.testing.assert_allclose(half_body.lame, 0.5 * full_body.lame)
    np.testing.assert_allclose(half_body.stiffness_matrices(), 0.5 * full_body.stiffness_matrices())
    assert stable_step(half, RUBBER, element_model("virial")).limit == pytest.approx(
        stable_step(whole, RUBBER, element_model("virial")).limit
    )


def test_a_cut_cage_keeps_the_volume_of_its_solid():
    """A cut splits vertices. The copies divide the mass according to the tetrahedra around each copy."""
    found = cage(ball(), cells=5).mesh
    left = found.vertices[found.tets].mean(axis=1)[:, 0] < 0
    corners = found.tets.astype(np.int64) + np.where(left, 0, len(found.vertices))[:, None]
    used, tets = np.unique(corners, return_inverse=True)
    half = found.part(used % len(found.vertices), tets.reshape(-1, 4).astype(np.int32), np.arange(len(left)))
    assert isinstance(half, CageMesh)
    assert len(half.vertices) > len(found.vertices)
    assert half.vertex_volumes.sum() == pytest.approx(found.vertex_volumes.sum())
    assert half.fill.tolist() == found.fill.tolist()


def test_a_cage_bears_the_weight_of_its_solid_whatever_part_of_it_is_full():
    """The compression of a block is density g height / E."""
    block = trimesh.creation.box((1.0, 1.0, 0.5)).apply_translation((0.03, 0.02, 0.01))
    asset = SoftBodyAsset.from_surface(block, RUBBER, cells=7)
    assert asset.mesh.fill.min() < 0.8
    assert sag(asset, 9.81) == pytest.approx(1000 * 9.81 * 0.5 / 1e6, rel=0.15)
