"""Rods: forces are the negative gradient of an independent energy, and bad input is refused."""

from copy import deepcopy
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from taichi_soft import (
    MaterialError,
    MeshError,
    OptionError,
    ParticleMesh,
    RodMaterial,
    RodMesh,
    box,
    force_gradient,
    internal_forces,
    rod,
    stable_step,
)
from taichi_soft.core.serialisation import as_plain, from_plain
from taichi_soft.elements.laws import element_model

YOUNG, POISSON, RADIUS, INNER = 2e5, 0.3, 0.02, 0.012
MATERIAL = RodMaterial(YOUNG, POISSON, 300, RADIUS, INNER)


def coil():
    turn = np.linspace(0.0, 3 * np.pi, 13)
    return RodMesh(np.stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), 0.03 * turn], axis=1))


def ring():
    """A ring that is not flat and has uneven edges at rest, so that its frames do not close."""
    turn = np.linspace(0.0, 2 * np.pi, 9)[:-1] + np.random.default_rng(1).uniform(-0.1, 0.1, 8)
    return RodMesh(
        np.stack([0.3 * np.cos(turn), 0.2 * np.sin(turn), 0.08 * np.cos(2 * turn + 0.4)], axis=1), closed=True
    )


def tangents(mesh, x):
    along = np.roll(x, -1, axis=0)[: len(mesh.edges)] - x[: len(mesh.edges)]
    return along / np.linalg.norm(along, axis=1, keepdims=True), np.linalg.norm(along, axis=1)


def smallest(a, b):
    """Return the smallest rotation from the direction a to b."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    if sine < 1e-14:
        return Rotation.identity()
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, a @ b))


def laid(directions):
    """Return frames without torsion along a rod, with the third axes along its edges."""
    frames = [smallest(np.array([0.0, 0.0, 1.0]), directions[0])]
    for before, after in pairwise(directions):
        frames.append(smallest(before, after) * frames[-1])
    return frames


def strains(mesh, frames):
    """Return 4 tan(angle / 4) times the axis of each joint's rotation, in the axes of the frames."""
    found = []
    for k in range(0 if mesh.closed else 1, len(mesh.edges)):
        vector = (frames[k - 1].inv() * frames[k]).as_rotvec()
        angle = np.linalg.norm(vector)
        found.append(vector * (4 * np.tan(angle / 4) / angle if angle > 1e-12 else 1.0))
    return np.array(found)


def energy_of(mesh, x, frames, rest):
    area = np.pi * (RADIUS**2 - INNER**2)
    second = np.pi / 4 * (RADIUS**4 - INNER**4)
    _, lengths = tangents(mesh, x)
    _, rest_lengths = tangents(mesh, mesh.vertices)
    total = YOUNG * area / 2 * ((lengths - rest_lengths) ** 2 / rest_lengths).sum()
    before = np.arange(0 if mesh.closed else 1, len(mesh.edges)) - 1
    spans = (rest_lengths[before] + rest_lengths[before + 1]) / 2
    stiffness = YOUNG * second * np.array([1.0, 1.0, 1 / (1 + POISSON)])
    return total + ((strains(mesh, frames) - rest) ** 2 * stiffness / spans[:, None]).sum() / 2


def settled(mesh, x, rest):
    """Return the frames of the shape x without torsion, turned about the edges to the least bending."""
    directions, _ = tangents(mesh, x)
    frames = laid(directions)

    def turned(angle):
        return [Rotation.from_rotvec(angle * t) * f for t, f in zip(directions, frames, strict=True)]

    inner = slice(1 if mesh.closed else 0, None)  # not the joint at which a ring closes
    found = min(
        (
            minimize_scalar(
                lambda a: ((strains(mesh, turned(a)) - rest)[inner, :2] ** 2 * spans_of(mesh)[inner]).sum(),
                bounds=(start, start + np.pi),
                method="bounded",
                options={"xatol": 1e-12},
            )
            for start in (-np.pi, -np.pi / 2, 0.0)
        ),
        key=lambda each: each.fun,
    )
    return turned(found.x)


def spans_of(mesh):
    _, lengths = tangents(mesh, mesh.vertices)
    before = np.arange(0 if mesh.closed else 1, len(mesh.edges)) - 1
    return 2 / (lengths[before] + lengths[before + 1])[:, None]


def gradient_of(mesh, x, frames, rest):
    """Differences of the energy. The frames follow their edges by the smallest rotation."""
    h, found, base = 1e-6, np.zeros_like(x), tangents(mesh, x)[0]
    for row in range(len(x)):
        for axis in range(3):
            values = []
            for sign in (1, -1):
                y = x.copy()
                y[row, axis] += sign * h
                moved = [
                    smallest(a, b) * f for a, b, f in zip(base, tangents(mesh, y)[0], frames, strict=True)
                ]
                values.append(energy_of(mesh, y, moved, rest))
            found[row, axis] = (values[0] - values[1]) / (2 * h)
    return found


@pytest.mark.parametrize("mesh", [coil(), ring(), rod(1.0, 6)], ids=["coil", "ring", "straight"])
def test_forces_are_the_negative_gradient_of_the_energy(mesh):
    x = mesh.vertices @ Rotation.from_rotvec((1.1, -0.4, 0.3)).as_matrix().T
    x = x + np.random.default_rng(0).normal(0, 0.02, x.shape)
    rest = strains(mesh, laid(tangents(mesh, mesh.vertices)[0]))
    frames = settled(mesh, x, rest)
    expected = -gradient_of(mesh, x, frames, rest)
    got = internal_forces(mesh, MATERIAL, x, law="rod")
    assert np.abs(got - expected).max() < 1e-5 * np.abs(expected).max()
    assert np.abs(got.sum(axis=0)).max() < 1e-12 * np.abs(got).max()


@pytest.mark.parametrize("mesh", [coil(), ring(), rod(1.0, 6)], ids=["coil", "ring", "straight"])
def test_the_turned_rest_shape_has_no_force(mesh):
    x = mesh.vertices @ Rotation.from_rotvec((2.0, 1.0, -0.5)).as_matrix().T + (5.0, -3.0, 2.0)
    scale = np.abs(internal_forces(mesh, MATERIAL, mesh.vertices * (1.1, 1.0, 0.9), law="rod")).max()
    assert np.abs(internal_forces(mesh, MATERIAL, x, law="rod")).max() < 1e-10 * scale


def test_damping_takes_energy_in_any_motion():
    mesh, rng = coil(), np.random.default_rng(5)
    damped = RodMaterial(YOUNG, POISSON, 1e-6, RADIUS, INNER, bending_damping=0.1)  # without inertia of spin
    still = RodMaterial(YOUNG, POISSON, 1e-6, RADIUS, INNER)
    for _ in range(20):
        x, v = mesh.vertices + rng.normal(0, 0.02, mesh.vertices.shape), rng.normal(0, 2.0, (13, 3))
        change = internal_forces(mesh, damped, x, v, law="rod") - internal_forces(mesh, still, x, law="rod")
        assert np.abs(change.sum(axis=0)).max() < 1e-10 * np.abs(change).max()
        assert (v * change).sum() < 0.0


def test_a_crushed_or_folded_rod_has_finite_forces():
    mesh = coil()
    for squeezed in (mesh.vertices * (1, 0, 0), mesh.vertices * 0.0, mesh.vertices[[*range(12), 10]]):
        forces = internal_forces(mesh, MATERIAL, squeezed, law="rod", dtype=np.float32)
        assert np.isfinite(forces).all()


@pytest.mark.numpy
def test_the_stable_step_of_a_straight_rod_is_the_time_of_sound_in_an_edge():
    """Bars of lumped masses have the highest frequency 2 c / l, so that the limit is l / c."""
    speed = np.sqrt(1e7 / 1000)
    found = stable_step(rod(1.0, 20), RodMaterial(1e7, 0.3, 1000, 0.005), element_model("rod")).limit
    assert found == pytest.approx(0.05 / speed, rel=0.02)
    # In a thick rod, bending is faster than sound: w = 2 c r / l^2.
    found = stable_step(rod(1.0, 20), RodMaterial(1e7, 0.3, 1000, 0.1), element_model("rod")).limit
    assert found == pytest.approx(0.05**2 / (0.1 * speed), rel=0.02)


@pytest.mark.numpy
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"young": 0}, "young is 0: it must be above 0 Pa"),
        ({"poisson": 0.6}, "poisson is 0.6: it must be above -1 and at most 0.5"),
        ({"density": -1}, "density is -1"),
        ({"radius": 0}, "radius is 0: it must be above 0 m"),
        ({"inner_radius": 0.01}, "inner_radius=0.01 m leaves no wall"),
        ({"inner_radius": -0.01}, "inner_radius is -0.01"),
        ({"damping": -1}, "damping is -1"),
        ({"bending_damping": np.inf}, "bending_damping is inf"),
        ({"young": [1.0, 2.0], "density": [1.0, 2.0, 3.0]}, "arrays of different lengths"),
    ],
)
def test_constants_out_of_range_are_refused(change, message):
    constants = {"young": 1e6, "poisson": 0.3, "density": 300, "radius": 0.01} | change
    with pytest.raises(MaterialError, match=message):
        RodMaterial(**constants)


@pytest.mark.numpy
@pytest.mark.parametrize(
    ("vertices", "closed", "message"),
    [
        ([(0, 0, 0)], False, "a rod needs 2 vertices, got 1"),
        ([(0, 0, 0), (1, 0, 0)], True, "a ring needs 3 vertices, got 2"),
        ([(0, 0, 0), (1, 0, 0), (1, 0, 0)], False, "vertices 1 and 2 are at the same position"),
        ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 0)], True, "vertices 3 and 0 are at the same position"),
        ([(0, 0, 0), (1, 0, 0), (0.5, 0.01, 0)], False, "turns back at vertex 1"),
        ([(0, 0, 0), (1, 0, 0), (0.5, 0.01, 0)], True, "turns back at vertex"),
        ([(0, 0, 0), (1, 0, np.nan)], False, "every number must be finite"),
    ],
)
def test_meshes_without_meaning_are_refused(vertices, closed, message):
    with pytest.raises(MeshError, match=message):
        RodMesh(vertices, closed=closed)


@pytest.mark.numpy
def test_a_rod_mesh_keeps_its_kind_when_it_is_moved_copied_and_stored():
    mesh = ring()
    stored = from_plain(as_plain(mesh))
    for other in (
        mesh.scaled(2.0),
        mesh.translated((1, 0, 0)),
        mesh.rotated(np.eye(3)),
        deepcopy(mesh),
        stored,
    ):
        assert isinstance(other, RodMesh)
        assert other.closed
        assert (other.edges == mesh.edges).all()
    with pytest.raises(OptionError, match="segments"):
        rod(1.0, 0)


def test_a_rod_is_refused_where_it_has_no_meaning():
    mesh = rod(1.0, 4)
    with pytest.raises(MaterialError, match="leave out law"):
        internal_forces(mesh, MATERIAL, mesh.vertices, law="springs")
    with pytest.raises(OptionError, match="force_gradient does not support a RodMesh"):
        force_gradient(mesh, MATERIAL, mesh.vertices, law="rod")
    with pytest.raises(MaterialError, match="3 values for a mesh of 4 edges"):
        internal_forces(mesh, RodMaterial([1.0, 2.0, 3.0], 0, 1, 1), mesh.vertices, law="rod")
    for other in (box((1, 1, 1), (1, 1, 1)), ParticleMesh(mesh.vertices, mesh.edges, 1.0)):
        with pytest.raises(MeshError, match="needs a RodMesh"):
            internal_forces(other, MATERIAL, other.vertices, law="rod")
