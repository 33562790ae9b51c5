"""Rods: chains of edges that resist stretching, bending and torsion.

These are discrete elastic rods (Bergou, Wardetzky, Robinson, Audoly and Grinspun 2008). Each edge carries a
frame, whose third axis is the edge's direction. When the edge moves, the frame follows by the smallest
rotation (time-parallel transport, Bergou, Audoly, Vouga, Wardetzky and Grinspun 2010). In addition, it spins
about the edge with its own inertia. So a frame stays attached to the material of the rod, and neither torsion
nor bending needs an angle that could jump.

The strain of a joint between two edges is the rotation between their frames, as in CoRdE (Spillmann and
Teschner 2007). Let the rotation have the axis a and the angle phi, and let s = tan(phi / 4) a, in the axes of
either frame (modified Rodrigues parameters, Schaub and Junkins 1996). The strain is 4 s: two components of
bending and one of torsion. For small angles it is phi a, up to phi^3 / 48. It is finite for every rotation,
and so are the moments. With the strain at rest, the energy of a joint is

    1/2 sum over k of B_k (4 s_k - rest_k)^2,    B = (E I / l, E I / l, G J / l),

where l is half the length of the two edges. If one frame turns by a small rotation d relative to the other,
4 s changes by (1 - s^2) d + 2 d x s + 2 (s . d) s. The moments on the two frames are opposite, so joints
conserve angular momentum. The component of a moment along its edge changes the spin. A pair of opposite
forces on the ends of the edge has the other components.

The spin has an angular momentum along the edge. When the edge turns, a pair of forces on its ends changes the
direction of this angular momentum (gyroscopic moment). It does no work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.residue import without_residue
from taichi_soft.core.runtime import ti
from taichi_soft.elements.materials.rod_material import RodMaterial
from taichi_soft.meshing.rod_mesh import RodMesh

Floats = NDArray[np.float64]

SHORTEST = 0.125
"""Smallest length of an edge, relative to its length at rest, as a lever arm. A crushed edge would otherwise
get forces without limit from the moments on it."""


@dataclass(frozen=True, eq=False)
class Rods:
    """Constants of a rod. Row i of `edges` belongs to the edge from vertex i to the next vertex, and row i of
    `joints` and `rest` to the joint of this edge and the edge before it, at vertex i.

    An end of an open rod has no joint, and its last vertex no edge. Their rows are zero.

    Attributes:
        edges: (n, 4) length at rest [m], stiffness E A [N], moment of inertia about the edge [kg m^2], 0.
        joints: (n, 4) stiffness of bending and of torsion [N m], `bending_damping` and `torsion_damping` [s].
        rest: (n, 4) strain at rest: bending about the first two axes of the frame, torsion, 0.
        is_closed: True for a ring.
    """

    edges: Floats
    joints: Floats
    rest: Floats
    is_closed: bool


@ti.func
def product(p, q):
    """Return the quaternion of the rotation `q`, followed by the rotation `p`."""
    v = p.w * q.xyz + q.w * p.xyz + p.xyz.cross(q.xyz)
    return ti.Vector([v.x, v.y, v.z, p.w * q.w - p.xyz.dot(q.xyz)])


@ti.func
def edge_direction(q):
    """Return the third axis of a frame `q`, which is the direction of its edge."""
    return ti.Vector(
        [
            2.0 * (q.x * q.z + q.w * q.y),
            2.0 * (q.y * q.z - q.w * q.x),
            q.w * q.w + q.z * q.z - q.x * q.x - q.y * q.y,
        ]
    )


@ti.func
def followed(q, direction):
    """Return the frame `q` after the smallest rotation that gives it another `direction`, a unit vector.

    If the direction is reversed, the frame turns about its first axis.
    """
    before = edge_direction(q)
    turn, w = before.cross(direction), 1.0 + before.dot(direction)
    is_reversed = w < 1e-6
    v = w * q.xyz + q.w * turn + turn.cross(q.xyz)
    moved = ti.Vector([v.x, v.y, v.z, w * q.w - turn.dot(q.xyz)])
    result = ti.select(is_reversed, ti.Vector([q.w, q.z, -q.y, -q.x]), moved)
    return result / ti.max(result.norm(), 1e-30)


@ti.func
def half_strain(p, q):
    """Return s, see the module: the rotation from the frame `p` to the frame `q`, in the axes of `p`."""
    v = p.w * q.xyz - q.w * p.xyz - p.xyz.cross(q.xyz)
    w = p.w * q.w + p.xyz.dot(q.xyz)
    return v * (ti.select(w < 0.0, -1.0, 1.0) / (1.0 + ti.abs(w)))


@ti.func
def joint_moment(s, rate, joint, rest):
    """Return the moment of a joint on its second frame [N m], in the axes of the first frame.

    Args:
        s: see `half_strain`.
        rate: angular velocity of the second frame relative to the first, in the axes of the first [rad/s].
        joint, rest: see `Rods`.
    """
    square = s.dot(s)
    change = (1.0 - square) * rate + 2.0 * rate.cross(s) + 2.0 * s.dot(rate) * s
    strain = 4.0 * s - rest.xyz + ti.Vector([joint.z, joint.z, joint.w]) * change
    n = ti.Vector([joint.x * strain.x, joint.x * strain.y, joint.y * strain.z])
    return -((1.0 - square) * n + 2.0 * s.cross(n) + 2.0 * s.dot(n) * s)


def rods_of(mesh: RodMesh, material: RodMaterial) -> Rods:
    """Return the constants of a rod."""
    n, count = len(mesh.vertices), len(mesh.edges)
    young, nu, density, radius, inner = (
        material.per_edge(name, count) for name in ("young", "poisson", "density", "radius", "inner_radius")
    )
    area, second = section(radius, inner)
    _, length = directions_of(mesh)
    edges, joints, rest = (np.zeros((n, 4)) for _ in range(3))
    edges[:count] = np.stack([length, young * area, density * 2.0 * second * length, 0.0 * length], axis=1)
    after = np.arange(0 if mesh.closed else 1, count)
    before = (after - 1) % n
    half = 0.5 * length
    bending, torsion = young * second, young / (1.0 + nu) * second
    for column, stiffness in enumerate((bending, torsion)):
        # The compliances of the two halves add up.
        joints[after, column] = 1.0 / (half[before] / stiffness[before] + half[after] / stiffness[after])
    for column, name in ((2, "bending_damping"), (3, "torsion_damping")):
        damping = material.per_edge(name, count)
        joints[after, column] = 0.5 * (damping[before] + damping[after])
    frames = rest_frames(mesh)
    rest[after, :3] = without_residue(4.0 * half_strains(frames[before], frames[after]))
    rest[np.abs(rest) < 1e-12] = 0.0
    return Rods(edges, joints, rest, mesh.closed)


def section(radius: Floats, inner: Floats) -> tuple[Floats, Floats]:
    """Return the area [m^2] and the second moment of area [m^4] of circular sections."""
    outer2, inner2 = radius * radius, inner * inner
    return np.pi * (outer2 - inner2), 0.25 * np.pi * (outer2 * outer2 - inner2 * inner2)


def directions_of(mesh: RodMesh) -> tuple[Floats, Floats]:
    """Return the directions, (k, 3), and lengths of the edges at rest, (k,) [m]."""
    return directions_at(mesh, mesh.vertices)


def directions_at(mesh: RodMesh, x: Floats) -> tuple[Floats, Floats]:
    """Return the directions, (k, 3), and lengths, (k,) [m], of the edges with vertices at `x`, (n, 3) [m]."""
    count = len(mesh.edges)
    along = x[(np.arange(count) + 1) % len(x)] - x[:count]
    length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1] + along[:, 2] * along[:, 2])
    return along / length[:, None], length


def rest_frames(mesh: RodMesh) -> Floats:
    """Return the frames of the edges at rest, as quaternions (k, 4).

    Each follows from the one before by the smallest rotation.
    """
    directions, _ = directions_of(mesh)
    frames, q = np.empty((len(directions), 4)), np.array([[0.0, 0.0, 0.0, 1.0]])
    for row in range(len(directions)):
        q = followed_rows(q, directions[row : row + 1])
        frames[row] = q[0]
    return frames


def followed_rows(q: Floats, directions: Floats) -> Floats:
    """Do the same as `followed`, in float64, for rows (m, 4) and (m, 3)."""
    x, y, z, w = q.T
    a = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w + z * z - x * x - y * y
    b = directions.T
    tx, ty, tz = (a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1)))
    tw = 1.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    moved = (
        tw * x + w * tx + ty * z - tz * y,
        tw * y + w * ty + tz * x - tx * z,
        tw * z + w * tz + tx * y - ty * x,
        tw * w - tx * x - ty * y - tz * z,
    )
    is_reversed = tw < 1e-6
    moved = tuple(np.where(is_reversed, *pair) for pair in zip((w, z, -y, -x), moved, strict=True))
    norm = np.sqrt(moved[0] * moved[0] + moved[1] * moved[1] + moved[2] * moved[2] + moved[3] * moved[3])
    return np.stack(moved, axis=1) / norm[:, None]


def half_strains(p: Floats, q: Floats) -> Floats:
    """Do the same as `half_strain`, in float64, for rows (m, 4). Returns: (m, 3)."""
    (px, py, pz, pw), (qx, qy, qz, qw) = p.T, q.T
    v = np.stack(
        [
            pw * qx - qw * px - (py * qz - pz * qy),
            pw * qy - qw * py - (pz * qx - px * qz),
            pw * qz - qw * pz - (px * qy - py * qx),
        ],
        axis=1,
    )
    w = pw * qw + px * qx + py * qy + pz * qz
    return np.asarray(v * (np.where(w < 0.0, -1.0, 1.0) / (1.0 + np.abs(w)))[:, None])
