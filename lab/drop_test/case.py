"""Random cases: a body and its course, determined by a seed and a case number."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.drop_test.course import HALF, Solid, make_course, random_rotation
from taichi_soft import Material, TetMesh, box, cylinder, element_model, sphere, stable_step, torus
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.types import Flips, FlipsName, LawName
from taichi_soft.elements.laws import LAWS

Floats = NDArray[np.float64]

SHAPES = ("box", "sphere", "cylinder", "torus", "beam")
"""Shapes of bodies. Case n has shape n modulo 5, so that all shapes are equally frequent."""

SMALLEST, LARGEST = 0.05, 10.0
"""Range of the longest edge of a body's bounding box [m]."""

SOFTEST, STIFFEST = 1e4, 1e8
"""Range of Young's modulus [Pa]."""

MOST_SAG = 0.1
"""Largest sag of a body under its own weight, estimated as density * g * size / E. Softer bodies would
collapse."""

FASTEST, FASTEST_RIM = 50.0, 10.0
"""`FASTEST` is the largest initial speed of the centre of mass [m/s]. `FASTEST_RIM` is the largest initial
angular velocity times the size of the body [m/s]."""

STEPS_PER_SECOND = 60


@dataclass(frozen=True)
class Case:
    """A body, its initial motion and its course."""

    seed: int
    number: int
    shape: str
    size: float  # longest edge of the body's bounding box [m]
    mesh: TetMesh
    material: Material
    damping_ratio: float
    position: Floats
    rotation: Floats
    velocity: Floats
    angular_velocity: Floats
    course: tuple[Solid, ...]
    law: LawName
    flips: FlipsName | None
    substeps: int  # number of substeps per step of 1/60 s

    @property
    def unit_time(self) -> float:
        """Unit of time limits [s]: sqrt(size / g), the time in which the body falls half its size."""
        return math.sqrt(self.size / GRAVITY_EARTH)

    @property
    def mach(self) -> float:
        """Initial speed divided by the speed of sound in the body.

        Above 1, only the body's mass resists an impact.
        """
        wave = math.sqrt(float(np.max(self.material.young / self.material.density)))
        return float(np.linalg.norm(self.velocity)) / wave

    def __str__(self) -> str:
        speed = np.linalg.norm(self.velocity)
        solids = ", ".join(solid.name for solid in self.course if solid.name not in ("wall", "lid"))
        first = self.course[0]
        restitution = "its own" if first.restitution is None else f"{first.restitution:.2f}"
        return (
            f"{self.shape} {self.size:.3g} m, E {self.material.young:.2g} Pa, "
            f"{self.material.density:.0f} kg/m^3, nu {self.material.poisson:.2f}, "
            f"{speed:.1f} m/s (Mach {self.mach:.2f}), friction {first.friction:.2f}, "
            f"restitution {restitution}; {solids}"
        )


def make_case(seed: int, number: int, law: LawName = "virial", flips: FlipsName | None = None) -> Case:
    """Make a random case.

    The damping is `edge_damping` with a ratio between 0.1 and 0.5, uniformly distributed.
    Args:
        seed, number: seed and case number. Together they determine the case.
        law: force law of the body.
        flips: treatment of inverted tetrahedra; by default "recover" if the law supports it.
    """
    if flips is None and law in LAWS and Flips.RECOVER in LAWS[law].flips:
        flips = Flips.RECOVER.value
    rng = np.random.default_rng([seed, number])
    shape = SHAPES[number % len(SHAPES)]
    size = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))))
    mesh = shape_mesh(shape, size, rng.uniform(size=2))
    density = float(rng.uniform(200.0, 3000.0))
    softest = max(SOFTEST, density * GRAVITY_EARTH * size / MOST_SAG)
    young = float(np.exp(rng.uniform(np.log(softest), np.log(STIFFEST))))
    ratio = float(rng.uniform(0.1, 0.5))
    damping = edge_damping(mesh, young, density, ratio)
    material = Material(young, float(rng.uniform(0.1, 0.45)), density, damping)
    place = size * np.array([*rng.uniform(1.0 - HALF, HALF - 1.0, 2), rng.uniform(5.0, 6.5)])
    longest = stable_step(mesh, material, element_model(law, flips=flips)).recommended
    spin = _direction(rng) * rng.uniform(0.0, FASTEST_RIM) / size
    return Case(
        seed,
        number,
        shape,
        size,
        mesh,
        material,
        ratio,
        place,
        random_rotation(rng),
        _direction(rng) * rng.uniform(0.0, FASTEST),
        spin,
        make_course(rng, size),
        law,
        flips,
        _rounded(1 / STEPS_PER_SECOND / longest),
    )


def edge_damping(mesh: TetMesh, young: float, density: float, share: float) -> float:
    """Return the damping b of an edge [N s/m]: share * l^2 * sqrt(E * density), with the mean edge length l.

    `share` is about the damping ratio of the fastest vibrations. Vibrations of wavelength L have the damping
    ratio share * l / L.
    """
    return share * float(mesh.edge_lengths.mean()) ** 2 * math.sqrt(young * density)


def shape_mesh(shape: str, size: float, parts: Floats) -> TetMesh:
    """Make the mesh of a shape.

    All meshes of one shape have equal numbers of vertices and tetrahedra, so that worlds share compiled
    kernels.
    Args:
        shape: one of `SHAPES`.
        size: longest edge of the mesh's bounding box [m].
        parts: two numbers from 0 to 1 that determine the proportions.
    """
    a, b = (float(part) for part in parts)
    if shape == "box":
        return box((size, size * (0.5 + 0.5 * a), size * (0.5 + 0.5 * b)), (3, 3, 3))
    if shape == "sphere":
        return sphere(size / 2, 3)
    if shape == "cylinder":
        slenderness = 0.5 * 4.0**a  # height / diameter
        height = size * min(1.0, slenderness)
        return cylinder(height / slenderness / 2, height, 2, 4)
    if shape == "torus":
        tube = 0.3 + 0.2 * a
        return torus(size / 2 / (1 + tube), size / 2 / (1 + tube) * tube, 1, 16)
    return box((size, size * (0.15 + 0.15 * a), size * (0.15 + 0.15 * b)), (8, 2, 2))


def _direction(rng: np.random.Generator) -> Floats:
    direction = rng.normal(size=3)
    return np.asarray(direction / np.linalg.norm(direction))


def _rounded(substeps: float) -> int:
    """Round a number of substeps up to 1, 2, 3, 4, 6, 8, 12, 16, ...

    Only cases with equal numbers of substeps can run in one world.
    """
    whole = 1 << max(0, math.ceil(math.log2(max(substeps, 1.0))))
    return whole * 3 // 4 if whole >= 4 and whole * 3 / 4 >= substeps else whole
