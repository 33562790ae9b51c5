"""Forces of the pairwise laws, edge by edge in NumPy float64 straight from thesis chapters 3 to 5.

Of taichi_soft only a mesh's `vertices`, `tets` and `edges` are used, and for CMPM where the corners of its
Voronoi faces are (tests/meshing/test_voronoi.py proves those).
"""

from itertools import permutations

import numpy as np


def signed_volume(x):
    """Return the signed volume of one tetrahedron (4, 3)."""
    return np.linalg.det(x[1:] - x[0]) / 6


def unit(v):
    """Return `v`, scaled to length 1."""
    return v / np.linalg.norm(v)


def tets_round(mesh, p, q):
    """Return (tetrahedron, a, b) for each tetrahedron at edge p-q. a, b are right-handed about p -> q."""
    found = []
    for t, tet in enumerate(mesh.tets.tolist()):
        if p in tet and q in tet:
            a, b = (v for v in tet if v not in (p, q))
            if signed_volume(mesh.vertices[[p, q, a, b]]) < 0:
                a, b = b, a
            found.append((t, a, b))
    return found


def quadrilateral(x, p, q, a, b):
    """Area vector of the subface of edge p-q: centres of the edge, of its two faces, of the tetrahedron."""
    edge = (x[p] + x[q]) / 2
    one, other = (x[p] + x[q] + x[a]) / 3, (x[p] + x[q] + x[b]) / 3
    middle = (x[p] + x[q] + x[a] + x[b]) / 4
    return (np.cross(one - edge, middle - edge) + np.cross(middle - edge, other - edge)) / 2


def edge_area(mesh, p, q):
    """Return the area of all subfaces of an edge at rest."""
    return sum(np.linalg.norm(quadrilateral(mesh.vertices, p, q, a, b)) for _, a, b in tets_round(mesh, p, q))


def mean_over(mesh, p, q, values):
    """Return the mean of values of the tetrahedra around an edge, weighted by the areas of its subfaces."""
    rows = [
        (np.linalg.norm(quadrilateral(mesh.vertices, p, q, a, b)), values[t])
        for t, a, b in tets_round(mesh, p, q)
    ]
    return sum(w * v for w, v in rows) / sum(w for w, _ in rows)


def spring(mesh, p, q, x, E, nu):
    """Return the force on p by eq. 5.2."""
    r, length = x[q] - x[p], np.linalg.norm(mesh.vertices[q] - mesh.vertices[p])
    stretch = (np.linalg.norm(r) - length) / length
    return mean_over(mesh, p, q, E) * edge_area(mesh, p, q) * stretch * unit(r)


def volume_spring(mesh, p, q, x, E, nu):
    """Return the force on p by eq. 5.2 and by eq. 5.5 with reversed sign."""
    force = spring(mesh, p, q, x, E, nu)
    for t, _, _ in tets_round(mesh, p, q):
        before, now = signed_volume(mesh.vertices[mesh.tets[t]]), signed_volume(x[mesh.tets[t]])
        growth = (abs(now) - before) / before
        force = force + E[t] * edge_area(mesh, p, q) * nu[t] * growth * unit(x[q] - x[p])
    return force


def double_spring(r, n, length, tensile, shear):
    """Return the force on p by eq.

    4.1 to 4.4: strain along n and along m, each times its modulus and the area.
    """
    m = r - (n @ r) * n
    force = tensile * (n @ r - length) / length * n
    if np.linalg.norm(m) > 0:
        force = force + shear * (unit(m) @ r) / length * unit(m)
    return force


def braked(r, n, relative_velocity, along, across):
    """Return the damping force on p by eq. 4.5: b_n along n and b_m along m."""
    m = r - (n @ r) * n
    force = along * (n @ relative_velocity) * n
    if np.linalg.norm(m) > 0:
        force = force + across * (unit(m) @ relative_velocity) * unit(m)
    return force


def cmpm(mesh, p, q, x, face):
    """Chapter 4; `face` holds the area at rest and the corners as (tetrahedron, barycentric weights)."""
    area, corners = face
    points = np.array([w @ x[mesh.tets[t]] for t, w in corners])
    center = (x[p] + x[q]) / 2
    turns = sum(
        np.cross(points[i] - center, points[(i + 1) % len(points)] - center) for i in range(len(points))
    )
    return x[q] - x[p], unit(turns), rest_length(mesh, p, q), area


def rest_length(mesh, p, q):
    """Return the rest length of an edge."""
    return np.linalg.norm(mesh.vertices[q] - mesh.vertices[p])


def carried(mesh, p, q, x, n0):
    """Where the tetrahedra round an edge carry the direction n0: mean of F n0 by subface areas."""
    total, weight = 0.0, 0.0
    for t, a, b in tets_round(mesh, p, q):
        rest, now = mesh.vertices[mesh.tets[t]], x[mesh.tets[t]]
        F = (now[1:] - now[0]).T @ np.linalg.inv((rest[1:] - rest[0]).T)
        share = np.linalg.norm(quadrilateral(mesh.vertices, p, q, a, b))
        total, weight = total + share * (F @ n0), weight + share
    return total / weight


def against_carried(mesh, p, q, x, normal):
    """Eq. 4.8 to 4.10 with the normal that `normal` makes of the positions, at rest and now."""
    return carried(mesh, p, q, x, normal(mesh.vertices)), normal(x), 1.0, edge_area(mesh, p, q)


def cmpm2(mesh, p, q, x):
    """Return the force of CMPM2 (section 4.4.1)."""
    ring = tets_round(mesh, p, q)
    return against_carried(
        mesh, p, q, x, lambda y: unit(sum(quadrilateral(y, p, q, a, b) for _, a, b in ring))
    )


def neighbours(mesh, p, q):
    """Return the vertices around an edge, in ascending order."""
    return sorted({v for _, a, b in tets_round(mesh, p, q) for v in (a, b)})


def fitted_normal(points, r):
    """Normal of the plane of least squares, towards r; of three points by the cross product."""
    if len(points) == 3:
        n = unit(np.cross(points[1] - points[0], points[2] - points[0]))
    else:
        n = np.linalg.svd(points - points.mean(axis=0))[2][2]
    return n if n @ r >= 0 else -n


def best_fitting_plane(mesh, p, q, x):
    """Return the force of the best fitting plane (section 4.4.2)."""
    ring = neighbours(mesh, p, q)

    def normal(y):
        points = y[ring] if len(ring) > 2 else np.vstack([y[ring], (y[p] + y[q]) / 2])
        return fitted_normal(points, y[q] - y[p])

    return against_carried(mesh, p, q, x, normal)


def turned_ring(mesh, p, q):
    """Vertices round an edge in the order in which they turn about it, from the lowest number on."""
    ring, x = np.array(neighbours(mesh, p, q)), mesh.vertices
    axis = unit(x[q] - x[p])
    arms = x[ring] - x[p] - np.outer((x[ring] - x[p]) @ axis, axis)
    turn = np.arctan2(np.cross(arms[0], arms) @ axis, arms @ arms[0])
    return ring[np.argsort(np.where(np.abs(turn) < 1e-9, 0.0, turn % (2 * np.pi)))]


def split_normal(mesh, p, q, y):
    """Cheap normal of 4.4.2: across the vectors between the means of two halves of the ring, split twice."""
    ring = turned_ring(mesh, p, q)

    def across(x):
        points = [x[v] for v in ring] + [(x[p] + x[q]) / 2] * (len(ring) == 2)
        half, vectors = len(points) // 2, []
        for first in (0, max(1, round(len(points) / 4))):
            turned = points[first:] + points[:first]
            vectors.append(np.mean(turned[:half], axis=0) - np.mean(turned[half:], axis=0))
        return np.cross(*vectors)

    towards_q = across(mesh.vertices) @ (mesh.vertices[q] - mesh.vertices[p])
    return unit(across(y)) * np.sign(towards_q)


def split_ring_plane(mesh, p, q, x):
    """Return the force of section 4.4.2 with the cheap normal."""
    return against_carried(mesh, p, q, x, lambda y: split_normal(mesh, p, q, y))


def tilt_angles(ring, x, p, q):
    """Angle of each particle over the plane across the edge in their mean height, and its unit arm."""
    axis = unit(x[q] - x[p])
    rise = (x[ring] - x[p]) @ axis
    arms = x[ring] - x[p] - np.outer(rise, axis)
    distance = np.linalg.norm(arms, axis=1)
    return np.arctan2(rise - rise.mean(), distance), arms / distance[:, None], axis


def represented_angles(arms, axis):
    """beta of 4.4.3: half the angle to the next particle on either side."""
    first = arms[0]
    angles = np.arctan2(np.cross(axis, first) @ arms.T, arms @ first) % (2 * np.pi)
    order = np.argsort(angles)
    gaps = np.diff(np.append(angles[order], angles[order][0] + 2 * np.pi))
    beta = np.empty(len(arms))
    beta[order] = (gaps + np.roll(gaps, 1)) / 2
    return beta


def rotated(v, axis, angle):
    """`v` turned about a unit axis by an angle (Rodrigues)."""
    return v * np.cos(angle) + np.cross(axis, v) * np.sin(angle) + axis * (axis @ v) * (1 - np.cos(angle))


def tilted_plane(mesh, p, q, x, b=2.0):
    """4.4.3 with c = b beta / 2 pi (eq. 4.12); b = 1/4 as printed, 2 to tilt by all of a shear."""
    ring = neighbours(mesh, p, q)
    rest, arms0, axis0 = tilt_angles(ring, mesh.vertices, p, q)
    c = b * represented_angles(arms0, axis0) / (2 * np.pi)
    now, arms, axis = tilt_angles(ring, x, p, q)
    turn = sum(ci * angle * np.cross(arm, axis) for ci, angle, arm in zip(c, now - rest, arms, strict=True))
    # A particle that rises lifts the plane on its side, so the normal leans away from it.
    angle = np.linalg.norm(turn)
    n = rotated(axis, unit(turn), angle) if angle > 0 else axis
    return x[q] - x[p], n, rest_length(mesh, p, q), edge_area(mesh, p, q)


def frame(law, mesh, p, q, x, face):
    """Return what a law of chapter 4 compares on an edge: r, n, rest length (1 for directions), and area.

    Return None if the law has no bond on this edge. `face` is the area that `cmpm` uses.
    """
    if law == "cmpm":
        return None if face is None else cmpm(mesh, p, q, x, face)
    if law.startswith("tilted_plane"):
        return tilted_plane(mesh, p, q, x, b=0.25 if law.endswith("printed") else 2.0)
    return {
        "cmpm2": cmpm2,
        "best_fitting_plane": best_fitting_plane,
        "split_ring_plane": split_ring_plane,
    }[law](mesh, p, q, x)


def bond(law, mesh, p, q, x, E, G, face):
    """Return the elastic force of a law of chapter 4 on p."""
    found = frame(law, mesh, p, q, x, face)
    if found is None:
        return np.zeros(3)
    r, n, length, area = found
    tensile, shear = (area * mean_over(mesh, p, q, value) for value in (E, G))
    return double_spring(r, n, length, tensile, shear)


def summed(mesh, force_on_first):
    """Forces on all vertices, (n, 3), from a function (p, q) of each edge."""
    total = np.zeros_like(mesh.vertices)
    for p, q in mesh.edges.tolist():
        force = force_on_first(p, q)
        total[p] += force
        total[q] -= force
    return total


def octahedron():
    """Make four slightly deformed tetrahedra around one inner edge."""
    points = np.array([[0, 0, -0.6], [0, 0, 0.7], [1, 0.1, 0.1], [0, 1.2, 0], [-0.9, 0, -0.1], [0.1, -1, 0]])
    return points, [[0, 1, 2, 3], [0, 1, 3, 4], [0, 1, 4, 5], [0, 1, 5, 2]]


def shuffled_tets(tets):
    """Each tetrahedron with its vertices in another of the twelve orders that keep it upright."""
    even = [order for order in permutations(range(4)) if np.linalg.det(np.eye(4)[list(order)]) > 0]
    return [[tet[i] for i in even[(5 * t + 3) % 12]] for t, tet in enumerate(tets)]
