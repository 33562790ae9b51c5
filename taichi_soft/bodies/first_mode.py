"""The slowest vibration of a free body, to which the damping ratio of its material belongs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.vibration import Vibration, vibration_of
from taichi_soft.cages.connected import components
from taichi_soft.core.residue import rounded

Floats = NDArray[np.float64]

_MORE = 3
"""Modes that are looked for beside those that are asked for: round bodies have several of one frequency."""

_AT_ONCE = 4
"""Columns that a product with the stiffness matrix takes: more fall out of a processor's cache."""

_MOST_ITERATIONS = 400
_WINDOW, _CHANGE = 10, 5e-3
"""Iterations, and change of the frequency's square in all of these, at which it ends if nothing is said. Of
long bodies and of letters a single one changes little long before the end."""

_ROUND_OFF = 1e-9
"""Length of a direction, as a part of the longest, below which it is round-off: made longer it would be rigid
motion as well. Bodies of few tetrahedra have no other directions left."""

MOST_PARTS = 30
"""Separate parts of a body whose rigid motions are set apart. With more it counts as undamped."""


def first_frequency(body: BodyDescription) -> float:
    """Angular frequency of the slowest vibration of a body that nothing holds [rad/s], from above by less
    than a fifth; 0 where it has none."""
    return first_mode(body)[0]


def guessed_frequency(body: BodyDescription) -> float:
    """The same of a body of tetrahedra by Ritz's method with polynomials, from above and soon found."""
    if body.bonds is not None:
        return 0.0
    _, bent = _polynomials(body)
    if bent.shape[1] == 0:
        return 0.0
    _, _, value = _ritz(bent, _applied(vibration_of(body), bent), 1)
    return rounded(float(np.sqrt(max(value[0], 0.0))))


def first_mode(body: BodyDescription, change: float = _CHANGE) -> tuple[float, Floats]:
    """The slowest vibration of a body that nothing holds: angular frequency [rad/s], and shape (n, 3), the
    largest entry being 1; 0 and zeros where it has none.

    Args: change: of the frequency's square in 10 iterations, at which it ends. The value comes from above.
    """
    frequencies, shapes = lowest_modes(body, 1, change)
    if len(frequencies) == 0:
        return 0.0, np.zeros_like(body.mesh.vertices)
    return rounded(float(frequencies[0])), shapes[0] / np.abs(shapes[0]).max()


def lowest_modes(body: BodyDescription, count: int, change: float) -> tuple[Floats, Floats]:
    """The slowest vibrations of a body that nothing holds: angular frequencies [rad/s], ascending, and shapes
    (k, n, 3), of which the squares weighted by mass sum to 1; fewer where it has no more.

    Ritz's method with polynomials of up to third order as a first guess, made better by locally optimal block
    conjugate gradients (Knyazev 2001). The values come from above.
    Args: change: of the sum of the frequencies' squares in 10 iterations, at which it ends.
    """
    vibration = vibration_of(body)
    rigid, bent = _polynomials(body)
    if bent.shape[1] == 0:
        return np.zeros(0), np.zeros((0, *body.mesh.vertices.shape))
    scale, block = vibration.diagonal()[:, None], count + _MORE
    # Modes that no polynomial has any part of would be found by way of round-off, sooner or later.
    anything = np.random.default_rng(0).normal(size=(len(bent), 1))
    anything -= rigid @ (rigid.T @ anything)
    bent = np.hstack([bent, anything / np.linalg.norm(anything)])
    u, image, value = _ritz(bent, _applied(vibration, bent), block)
    conjugate = conjugate_image = np.zeros((len(u), 0))
    sums = [value[:count].sum()]
    while len(sums) <= _MOST_ITERATIONS:
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
    """K of the columns of u, (3n, k); a few at a time, which stay in a processor's cache."""
    parts = [u[:, k : k + _AT_ONCE] for k in range(0, u.shape[1], _AT_ONCE)]
    return np.hstack(
        [vibration.apply(part.reshape(-1, 3, part.shape[1])).reshape(part.shape) for part in parts]
    )


def _ritz(directions: Floats, images: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """The slowest `count` vibrations that can be made of directions (3n, k), of which images by K are given.

    Returns: these, their images and the squares of their frequencies.
    """
    lengths = np.linalg.norm(directions, axis=0)
    real = lengths > _ROUND_OFF * lengths.max()
    directions, images = directions[:, real] / lengths[real], images[:, real] / lengths[real]
    sizes, mixed = np.linalg.eigh(directions.T @ directions)
    mixed = mixed[:, sizes > 1e-10] / np.sqrt(sizes[sizes > 1e-10])
    small = mixed.T @ (directions.T @ images) @ mixed
    values, vectors = np.linalg.eigh((small + small.T) / 2)
    mixed = mixed @ vectors[:, :count]
    return directions @ mixed, images @ mixed, values[:count]


def _orthonormal(directions: Floats) -> Floats:
    left, sizes, _ = np.linalg.svd(directions / np.linalg.norm(directions, axis=0).max(), full_matrices=False)
    return np.asarray(left[:, sizes > 1e-6 * sizes[0]])


def _polynomials(body: BodyDescription) -> tuple[Floats, Floats]:
    """Orthonormal rigid motions, and others of first to third order, times the root of masses."""
    x, one, root = _centred(body.mesh.vertices, body.masses), np.ones(len(body.masses)), np.sqrt(body.masses)
    first = [one, *x.T]
    second = [x[:, a] * x[:, b] for a in range(3) for b in range(a, 3)]
    third = [x[:, a] * x[:, b] * x[:, c] for a in range(3) for b in range(a, 3) for c in range(b, 3)]
    all_moves = _moves([(a, root * amount) for amount in (*first, *second, *third) for a in range(3)])
    rigid = _rigid_motions(body)
    beside = all_moves - rigid @ (rigid.T @ all_moves)
    return rigid, beside[:, np.linalg.norm(beside, axis=0) > 1e-6 * np.linalg.norm(all_moves, axis=0)]


def _rigid_motions(body: BodyDescription) -> Floats:
    """Orthonormal rigid motions (3n, k), times the root of masses: six for each of the parts that share no
    vertex, as none of these strains anything; of the `MOST_PARTS` largest parts."""
    tets = body.mesh.tets
    part = components(len(body.masses), np.concatenate([tets[:, [0, k]] for k in (1, 2, 3)]))
    found = []
    for number in np.argsort(-np.bincount(part), kind="stable")[:MOST_PARTS]:
        rows = part == number
        mass = body.masses[rows]
        x, root = _centred(body.mesh.vertices[rows], mass), np.sqrt(mass)
        shifts = [_moves([(a, root)]) for a in range(3)]
        turns = [
            _moves([(a, root * x[:, b])]) - _moves([(b, root * x[:, a])]) for a, b in ((0, 1), (1, 2), (2, 0))
        ]
        motions = _orthonormal(np.hstack([*shifts, *turns]))
        found.append(np.zeros((body.mesh.vertices.size, motions.shape[1]), order="F"))
        found[-1][np.repeat(rows, 3)] = motions
    return np.hstack(found)


def _centred(x: Floats, mass: Floats) -> Floats:
    """Places (n, 3) relative to their centre of mass, in units of the largest coordinate."""
    x = x - mass @ x / mass.sum()
    return np.asarray(x / (np.abs(x).max() + 1e-300))


def _moves(amounts: Sequence[tuple[int, Floats]]) -> Floats:
    """Displacements (3n, k), each by an amount (n,) along one axis."""
    columns = np.zeros((len(amounts[0][1]), 3, len(amounts)))
    for k, (axis, amount) in enumerate(amounts):
        columns[:, axis, k] = amount
    return columns.reshape(-1, len(amounts))
