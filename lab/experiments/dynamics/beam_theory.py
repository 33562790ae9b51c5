"""First natural frequencies of a Timoshenko beam (1921), by Ritz's method with Legendre polynomials.

For a deflection w and a rotation t of the sections, the elastic energy is 1/2 int E I (dt/dx)^2 + kappa G A
(dw/dx - t)^2 dx. At the angular frequency o, the kinetic energy is o^2/2 int rho A w^2 + rho I t^2 dx.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DEGREE = 12
"""Number of polynomials. With 12, the first frequency has seven correct digits."""


@dataclass(frozen=True)
class Beam:
    """A straight beam of rectangular section that bends in the direction of its height. SI units."""

    length: float
    width: float
    height: float
    young: float
    poisson: float
    density: float

    @property
    def area(self) -> float:
        """Area of the section [m^2]."""
        return self.width * self.height

    @property
    def inertia(self) -> float:
        """Second moment of area of the section [m^4]."""
        return self.width * self.height**3 / 12

    @property
    def shear_coefficient(self) -> float:
        """Shear coefficient kappa of a rectangle (Cowper 1966)."""
        return 10 * (1 + self.poisson) / (12 + 11 * self.poisson)


def euler_bernoulli_frequency(beam: Beam, *, is_held: bool) -> float:
    """Return the first natural frequency of a cantilever (`is_held`) or a free beam [Hz].

    Euler-Bernoulli theory ignores shear and gives a closed form.
    """
    root = 1.87510407 if is_held else 4.73004074
    speed = np.sqrt(beam.young * beam.inertia / (beam.density * beam.area))
    return float(root**2 / beam.length**2 * speed / (2 * np.pi))


def timoshenko_frequency(beam: Beam, *, is_held: bool) -> float:
    """Return the first non-zero natural frequency of a cantilever (`is_held`) or a free beam [Hz]."""
    at, weights = legendre.leggauss(DEGREE + 4)
    weights = weights * beam.length / 2
    values = legendre.legvander(at, DEGREE)
    slopes = np.stack([legendre.legval(at, legendre.legder(row)) for row in np.eye(DEGREE + 1)], axis=1)
    if is_held:  # multiply by the distance from the clamp, so that the deflection there is zero
        slopes = slopes * (at + 1)[:, None] + values
        values = values * (at + 1)[:, None]
    slopes = slopes * 2 / beam.length
    none = np.zeros_like(values)
    shear_modulus = beam.young / (2 * (1 + beam.poisson))
    stiffness = _gram(np.hstack([none, slopes]), weights * beam.young * beam.inertia) + _gram(
        np.hstack([slopes, -values]), weights * beam.shear_coefficient * shear_modulus * beam.area
    )
    mass = _gram(np.hstack([values, none]), weights * beam.density * beam.area) + _gram(
        np.hstack([none, values]), weights * beam.density * beam.inertia
    )
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    squares = np.linalg.eigvalsh(inverse @ stiffness @ inverse.T)
    first = squares[squares > 1e-6 * squares[5]][0]
    return float(np.sqrt(first) / (2 * np.pi))


def first_shape(along: Floats, *, is_held: bool) -> Floats:
    """Return the deflection in the first mode of an Euler-Bernoulli beam, scaled to a maximum of about 1.

    Args:
        along: positions along the beam divided by its length, from 0 (at the clamp) to 1.
    """
    if is_held:
        k, s = 1.87510407, 0.73409551
        shape = np.cosh(k * along) - np.cos(k * along) - s * (np.sinh(k * along) - np.sin(k * along))
    else:
        k, s = 4.73004074, 0.98250221
        shape = np.cosh(k * along) + np.cos(k * along) - s * (np.sinh(k * along) + np.sin(k * along))
    return np.asarray(shape / 2)


def _gram(rows: Floats, weights: Floats) -> Floats:
    return np.asarray(rows.T @ (weights[:, None] * rows))
