"""Compute the largest stable substep from the vibrations of a body at rest.

Leapfrog with a lagging damper, x'' = -K x - C x' in units where M = 1, is

    x_(n+1) - 2 x_n + x_(n-1) = -h^2 K x_n - h C (x_n - x_(n-1)).

Let d be the difference and s the mean of two successive positions. Because
x_n - x_(n-1) = (x_(n+1) - x_(n-1)) / 2 - (x_(n+1) - 2 x_n + x_(n-1)) / 2, the energy
1/2 d^T (1 - h C / 2 - h^2 K / 4) d + 1/2 s^T h^2 K s never grows. The step h is therefore stable exactly if
the largest eigenvalue of h^2 K + 2 h C is below 4. Lazy leapfrog makes the same steps. Lanczos' method
approaches that eigenvalue from below. The error bound of the method is added, so that the estimated limit is
never above the true limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.vibration import TetVibration, Vibration, vibration_of
from taichi_soft.core.errors import OptionError
from taichi_soft.core.residue import rounded
from taichi_soft.elements.laws import ElementModel, fit_model
from taichi_soft.elements.laws.bonds import Bonds
from taichi_soft.elements.materials import AnyMaterial
from taichi_soft.meshing import BodyMesh, TetMesh

Floats = NDArray[np.float64]

MARGIN = 0.9
"""Recommended substep, as a fraction of the largest stable substep for small motion. The margin is
necessary, because compression makes elements stiffer than at rest."""

_MAX_ITERATIONS = 120
_MIN_ITERATIONS = 30
"""Smallest number of iterations of Lanczos' method. Regular meshes have many nearly equal eigenvalues, so
fewer iterations could miss the largest eigenvalue."""

_RESIDUAL = 0.02
"""Relative residual at which Lanczos' method ends. For safety, the eigenvalue is then increased by this
fraction, which shortens the step by 1 %."""

_DAMPING_PASSES = 8

SLIVER_ANGLE = 15.0
"""Dihedral angle [degrees] below which a tetrahedron counts as a sliver. A regular tetrahedron has
dihedral angles of 70.5 degrees."""


@dataclass(frozen=True)
class StableStep:
    """Largest stable substep of one body, and the reason for it."""

    limit: float  # [s], limit for small motion; 0 to 15 % below the true limit
    stiffest_tet: int | None  # tetrahedron with the highest frequency, in the caller's order
    period: float  # [s], period of the fastest vibration
    stiffest_edge: tuple[int, int] | None = None  # stiffest edge, for a law along edges, a shell and a rod
    undamped: float = 0.0  # [s], limit without damping
    slivers: int = 0  # number of flat tetrahedra with a limit below half of the limits' first percentile
    without_slivers: float = 0.0  # [s], approximate limit without slivers
    tets: int = 0  # number of tetrahedra of the body

    @property
    def stiffest(self) -> str:
        """Description of the stiffest element."""
        if self.stiffest_edge is not None:
            return f"stiffest edge from vertex {self.stiffest_edge[0]} to {self.stiffest_edge[1]}"
        return f"stiffest tetrahedron {self.stiffest_tet}"

    @property
    def reason(self) -> str:
        """Explanation of the limit, with a suggested fix."""
        if self.limit < 0.5 * self.undamped:
            fix = "use less"
            if self.tets:
                fix = "give the material a damping_ratio instead of damping, which needs none"
            return f"damping causes {100 * (1 - self.limit / self.undamped):.3g} % of them: {fix}"
        if self.slivers:
            share = 100 * (1 - self.limit / self.without_slivers)
            return (
                f"{self.slivers:,} of {self.tets:,} tetrahedra are slivers, which cause {share:.3g} % of "
                "them: remove them by mesh.improved()"
            )
        return f"it has small or stiff elements ({self.stiffest}): use a coarser mesh or a softer material"

    @property
    def recommended(self) -> float:
        """Substep with a margin for large deformations [s]."""
        return MARGIN * self.limit


RIGID_STEP = StableStep(1.0 / (600.0 * MARGIN), None, math.inf, undamped=1.0 / (600.0 * MARGIN))
"""Substep of worlds that contain only rigid bodies: ten in a frame of 1/60 s. Motion is stable in any
substep, but stacks need several for the impulses of contact to reach the top."""


def stable_step(mesh: BodyMesh, material: AnyMaterial, model: ElementModel) -> StableStep:
    """Estimate the largest stable substep of leapfrog and lazy leapfrog; explicit Euler has no such substep.

    The estimate holds for small motion about the rest shape. A strongly compressed body is stiffer, and a
    flattened tetrahedron has no stable substep at all, so `recommended` leaves a margin. The estimate ignores
    pins, which can only increase the limit.
    Args:
        mesh: rest shape.
        material: constants that fit the mesh.
        model: force model, from `element_model`.
    Raises: MeshError, MaterialError or OptionError for arguments that do not fit together.
    """
    if not isinstance(model, ElementModel):
        raise OptionError(f"model must come from element_model(...), got {model!r}")
    body = BodyDescription(mesh, material, fit_model(model, mesh, material))
    vibration = vibration_of(body)
    bound, stiffest_tet, stiffest_edge, slivers, typical = np.inf, None, None, 0, np.inf
    start = np.random.default_rng(0).normal(size=vibration.shape)
    if isinstance(vibration, TetVibration):
        bounds = vibration.element_bounds()
        bound, stiffest_tet = float(bounds.max()), int(bounds.argmax())
        typical = float(np.quantile(bounds, 0.99, method="lower"))
        assert isinstance(mesh, TetMesh)
        is_flat = mesh.quality.min_dihedral < SLIVER_ANGLE
        slivers = int(((bounds > 4.0 * typical) & is_flat).sum())
    elif body.bonds is not None:
        stiffest_edge = _stiffest_edge(body, body.bonds)
    frequency2, u = largest_eigenvalue(vibration.apply, start)
    if body.shells is not None or body.rods is not None:
        stiffest_edge = _fastest_edge(body, u)
    frequency2 = rounded(min(frequency2, bound))
    undamped = 2.0 / np.sqrt(frequency2)
    limit = undamped
    if vibration.is_damped:
        limit = min(rounded(_damped_limit(vibration, undamped, u, start)), undamped)
    return StableStep(
        float(limit),
        stiffest_tet,
        float(2 * np.pi / np.sqrt(frequency2)),
        stiffest_edge,
        float(undamped),
        slivers,
        float(limit * max(1.0, np.sqrt(frequency2 / typical))),
        len(mesh.tets),
    )


def _damped_limit(vibration: Vibration, undamped: float, u: Floats, start: Floats) -> float:
    """Find the step h at which the largest eigenvalue of h^2 K + 2 h C is 4, by Newton's method from above.

    If K is symmetric, the solution h of h^2 u'Ku + 2 h u'Cu = 4 is not below this step for any direction u.
    If h is multiplied by t, the eigenvalue is multiplied by at most t for t < 1, and at most t^2 for t > 1.
    The last correction uses this bound.
    """
    h, value = undamped, np.inf
    for _ in range(_DAMPING_PASSES):
        h = min(h, _touching_step(vibration, u, h)) if value > 4.0 else h * np.sqrt(4.0 / value)
        value, u = largest_eigenvalue(lambda w, h=h: vibration.apply(w, h), u + 0.1 * _scaled(start, u))  # type: ignore[misc]
        if abs(value - 4.0) < 8 * _RESIDUAL:
            break
    return float(h * (4.0 / value) ** (1.0 if value > 4.0 else 0.5))


def _scaled(start: Floats, u: Floats) -> Floats:
    return np.asarray(start * (np.linalg.norm(u) / np.linalg.norm(start)))


def _touching_step(vibration: Vibration, u: Floats, h: float) -> float:
    """Return the step h at which h^2 u'Ku + 2 h u'Cu is 4, for u scaled to length 1."""
    u = u / np.linalg.norm(u)
    stiffness = float(np.vdot(u, vibration.apply(u)))
    damping = (float(np.vdot(u, vibration.apply(u, h))) - h * h * stiffness) / (2 * h)
    return 4.0 / float(damping + np.sqrt(damping**2 + 4 * max(stiffness, 0.0)))


def largest_eigenvalue(apply: Callable[[Floats], Floats], start: Floats) -> tuple[float, Floats]:
    """Return an upper bound of an operator's largest eigenvalue, and its eigenvector, by Arnoldi's method.

    For symmetric operators, this is Lanczos' method. Operators of laws along edges can be asymmetric. The
    result is then the largest magnitude of an eigenvalue.
    """
    shape, basis = start.shape, np.zeros((_MAX_ITERATIONS + 1, start.size))
    small = np.zeros((_MAX_ITERATIONS + 1, _MAX_ITERATIONS))
    basis[0] = (start / np.linalg.norm(start)).ravel()
    for k in range(1, _MAX_ITERATIONS + 1):
        image = apply(basis[k - 1].reshape(shape)).ravel()
        for _ in range(2):  # twice, because round-off spoils the first orthogonalisation
            part = basis[:k] @ image
            image = image - part @ basis[:k]
            small[:k, k - 1] += part
        norm = np.linalg.norm(image)
        small[k, k - 1] = norm
        is_last = k == _MAX_ITERATIONS or norm <= 1e-12 * np.abs(small[:k, :k]).max()
        if is_last or (k >= _MIN_ITERATIONS and k % 10 == 0):
            values, vectors = np.linalg.eig(small[:k, :k])
            top = int(np.abs(values).argmax())
            value, residual = float(np.abs(values[top])), float(norm * np.abs(vectors[-1, top]))
            if is_last or residual <= _RESIDUAL * value:
                break
        basis[k] = image / norm
    direction = vectors[:, top].real @ basis[:k]
    return value + max(residual, _RESIDUAL * value), direction.reshape(shape)


def _fastest_edge(body: BodyDescription, u: Floats) -> tuple[int, int]:
    """Return the edge whose ends move most relative to each other in the mode `u`, (n, 3 or 4, 1)."""
    edges = body.mesh.edges
    moved = u[:, :3, 0] / np.sqrt(body.masses)[:, None]
    worst = int(((moved[edges[:, 1]] - moved[edges[:, 0]]) ** 2).sum(axis=1).argmax())
    return int(edges[worst, 0]), int(edges[worst, 1])


def _stiffest_edge(body: BodyDescription, bonds: Bonds) -> tuple[int, int]:
    edges = body.mesh.edges
    per_mass = (1 / body.masses[edges]).sum(axis=1)
    along_and_across = bonds.constants[:, 1:2] if body.model.has_simple_edges else bonds.constants[:, 1:3]
    worst = int((along_and_across.max(axis=1) * per_mass).argmax())
    return int(edges[worst, 0]), int(edges[worst, 1])
