"""Slowest vibration of a free body. The damping ratio of a material refers to this vibration's frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.vibration import Vibration, vibration_of
from taichi_soft.cages.connected import components
from taichi_soft.core.residue import rounded

Floats = NDArray[np.float64]

_EXTRA_MODES = 3
"""Number of modes that are computed in addition to the requested modes. They are needed for round bodies,
which have several modes of equal frequency."""

_CHUNK = 4
"""Number of columns that are multiplied by the stiffness matrix at once. More columns would not fit into
the cache."""

_MAX_ITERATIONS = 400
_WINDOW, _CHANGE = 10, 5e-3
"""The search for modes ends when the squared frequency changes by less than the fraction _CHANGE in
_WINDOW iterations. A single iteration is not enough: in a long body, it can change the frequency very
little although the search is far from converged."""

_ROUND_OFF = 1e-9
"""Smallest length of a search direction, as a fraction of the longest direction. Shorter directions are
round-off and are discarded, because they would contain rigid motion after normalisation. They appear soon
in bodies of few tetrahedra."""

MAX_PARTS = 30
"""Largest number of separate components of a body whose rigid motions are removed. A body with more
components counts as undamped."""


def first_frequency(body: BodyDescription) -> float:
    """Return the angular frequency of the slowest vibration of a free body [rad/s], at most 20 % too high.

    The frequency is 0 if the body cannot vibrate.
    """
    return first_mode(body)[0]


def guessed_frequency(body: BodyDescription) -> float:
    """Return a fast upper bound of the first angular frequency [rad/s], by Ritz's method with polynomials.

    The bound is 0 for pairwise laws, shells and rods.
    """
    if not body.model.has_tets:
        return 0.0
    _, deformed = _polynomials(body)
    if deformed.shape[1] == 0:
        return 0.0
    _, _, value = _ritz(deformed, _applied(vibration_of(body), deformed), 1)
    return rounded(float(np.sqrt(max(value[0], 0.0))))


def first_mode(body: BodyDescription, change: float = _CHANGE) -> tuple[float, Floats]:
    """Return the slowest vibration of a free body: angular frequency [rad/s], and shape (n, 3).

    The largest entry of the shape is 1. Frequency and shape are 0 if the body cannot vibrate. The frequency
    is an upper bound.
    Args: change: relative change of the squared frequency in 10 iterations at which the search ends.
    """
    frequencies, shapes = lowest_modes(body, 1, change)
    if len(frequencies) == 0:
        return 0.0, np.zeros_like(body.mesh.vertices)
    return rounded(float(frequencies[0])), shapes[0] / np.abs(shapes[0]).max()


def lowest_modes(body: BodyDescription, count: int, change: float) -> tuple[Floats, Floats]:
    """Return the slowest vibrations of a free body: ascending angular frequencies [rad/s], shapes (k, n, 3).

    The squared entries of a shape, weighted by mass, sum to 1. If the body has fewer than `count` vibrations,
    all of them are returned. Ritz's method with polynomials of up to third order gives a first guess. The
    locally optimal block conjugate gradient method refines this guess (Knyazev 2001). The frequencies are
    upper bounds.
    Args: change: relative change of the sum of squared frequencies in 10 iterations at which the search ends.
    """
    vibration = vibration_of(body)
    rigid, deformed = _polynomials(body)
    if deformed.shape[1] == 0:
        return np.zeros(0), np.zeros((0, *body.mesh.vertices.shape))
    scale, block = vibration.diagonal()[:, None], count + _EXTRA_MODES
    # Without a random direction, only round-off would produce modes that are orthogonal to all polynomials.
    random_direction = np.random.default_rng(0).normal(size=(len(deformed), 1))
    random_direction -= rigid @ (rigid.T @ random_direction)
    deformed = np.hstack([deformed, random_direction / np.linalg.norm(random_direction)])
    u, image, value = _ritz(deformed, _applied(vibration, deformed), block)
    conjugate = conjugate_image = np.zeros((len(u), 0))
    sums = [value[:count].sum()]
    while len(sums) <= _MAX_ITERATIONS:
        step = (image - u * value) / scale
        step -= rigid @ (rigid.T @ step)
        directions = np.hstack([u, step, conjugate])
        images = np.hstack([image, _applied(vibration, step), conjugate_image])
        new, new_image, value = _ritz(directions, images, block)
        part = u.T @ new
        conjugate, conjugate_image = new - u @ part, new_image - image @ part
        u, image = new, new_image
        sums.append(value[:count].sum())
        if len(sums) > _WINDOW and sums[-1 - _WINDOW] - sums[-1] <= change * sums[-1]:
            break
    shapes = u[:, :count].T.reshape(-1, *body.mesh.vertices.shape) / np.sqrt(body.masses)[:, None]
    return np.sqrt(np.maximum(value[:count], 0.0)), shapes


def _applied(vibration: Vibration, u: Floats) -> Floats:
    """Return K times u, (3n, k). A few columns are multiplied at a time, so that they stay in the cache."""
    parts = [u[:, k : k + _CHUNK] for k in range(0, u.shape[1], _CHUNK)]
    return np.hstack(
        [vibration.apply(part.reshape(-1, 3, part.shape[1])).reshape(part.shape) for part in parts]
    )


def _ritz(directions: Floats, images: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Find the slowest `count` vibrations in the span of `directions`, (3n, k).

    Args: images: K times `directions`.
    Returns: the vibrations (3n, count), K times the vibrations, and the squared frequencies (count,).
    """
    lengths = np.linalg.norm(directions, axis=0)
    is_valid = lengths > _ROUND_OFF * lengths.max()
    directions, images = directions[:, is_valid] / lengths[is_valid], images[:, is_valid] / lengths[is_valid]
    sizes, basis = np.linalg.eigh(directions.T @ directions)
    basis = basis[:, sizes > 1e-10] / np.sqrt(sizes[sizes > 1e-10])
    small = basis.T @ (directions.T @ images) @ basis
    values, vectors = np.linalg.eigh((small + small.T) / 2)
    basis = basis @ vectors[:, :count]
    return directions @ basis, images @ basis, values[:count]


def _orthonormal(directions: Floats) -> Floats:
    left, sizes, _ = np.linalg.svd(directions / np.linalg.norm(directions, axis=0).max(), full_matrices=False)
    return np.asarray(left[:, sizes > 1e-6 * sizes[0]])


def _polynomials(body: BodyDescription) -> tuple[Floats, Floats]:
    """Return orthonormal rigid motions (3n, k), and deformations of first to third order (3n, d).

    The columns are displacements times the square root of the masses.
    """
    x, one, root = _centred(body.mesh.vertices, body.masses), np.ones(len(body.masses)), np.sqrt(body.masses)
    first = [one, *x.T]
    second = [x[:, a] * x[:, b] for a in range(3) for b in range(a, 3)]
    third = [x[:, a] * x[:, b] * x[:, c] for a in range(3) for b in range(a, 3) for c in range(b, 3)]
    displacements = _displacements(
        [(a, root * amount) for amount in (*first, *second, *third) for a in range(3)]
    )
    rigid = _rigid_motions(body)
    deformations = displacements - rigid @ (rigid.T @ displacements)
    return rigid, deformations[
        :, np.linalg.norm(deformations, axis=0) > 1e-6 * np.linalg.norm(displacements, axis=0)
    ]


def _rigid_motions(body: BodyDescription) -> Floats:
    """Return orthonormal rigid motions, times the square root of the masses, (3n, k).

    Components that share no vertices move independently. The result contains six motions for each of the
    `MAX_PARTS` largest components.
    """
    tets = body.mesh.tets
    part = components(len(body.masses), np.concatenate([tets[:, [0, k]] for k in (1, 2, 3)]))
    found = []
    for number in np.argsort(-np.bincount(part), kind="stable")[:MAX_PARTS]:
        rows = part == number
        mass = body.masses[rows]
        x, root = _centred(body.mesh.vertices[rows], mass), np.sqrt(mass)
        translations = [_displacements([(a, root)]) for a in range(3)]
        rotations = [
            _displacements([(a, root * x[:, b])]) - _displacements([(b, root * x[:, a])])
            for a, b in ((0, 1), (1, 2), (2, 0))
        ]
        motions = _orthonormal(np.hstack([*translations, *rotations]))
        found.append(np.zeros((body.mesh.vertices.size, motions.shape[1]), order="F"))
        found[-1][np.repeat(rows, 3)] = motions
    return np.hstack(found)


def _centred(x: Floats, mass: Floats) -> Floats:
    """Return positions (n, 3) relative to their centre of mass, divided by the largest coordinate."""
    x = x - mass @ x / mass.sum()
    return np.asarray(x / (np.abs(x).max() + 1e-300))


def _displacements(amounts: Sequence[tuple[int, Floats]]) -> Floats:
    """Return displacements (3n, k), one column for each pair of an axis and amounts (n,) along this axis."""
    columns = np.zeros((len(amounts[0][1]), 3, len(amounts)))
    for k, (axis, amount) in enumerate(amounts):
        columns[:, axis, k] = amount
    return columns.reshape(-1, len(amounts))
