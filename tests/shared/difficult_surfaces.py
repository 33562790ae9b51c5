"""Twenty surfaces with which other meshers fail. Each is about 1 m wide unless its name says otherwise."""

import numpy as np
import trimesh
from surfaces import ball, joined, turned, with_some_turned, with_triangles, without


def _grid(rows, columns, place, *, closed_u=True, closed_v=True, twisted=False):
    """Return triangles over a grid whose ends can be joined.

    If `twisted` is True, the last row is joined to the first row in reverse order.
    """
    u, v = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    vertices = place(2 * np.pi * u.ravel() / rows, 2 * np.pi * v.ravel() / columns)

    def number(i, j):
        wraps = i >= rows
        return (i % rows) * columns + (np.where(wraps & twisted, columns - j, j)) % columns

    i, j = (
        each.ravel()
        for each in np.meshgrid(
            np.arange(rows if closed_u else rows - 1),
            np.arange(columns if closed_v else columns - 1),
            indexing="ij",
        )
    )
    a, b, c, d = number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return trimesh.Trimesh(vertices, faces, process=False)


def torus_knot(p=2, q=3, thickness=0.12):
    """Make a tube along a knot on a torus."""

    def middle(t):
        r = np.cos(q * t) + 2.0
        return np.stack([r * np.cos(p * t), r * np.sin(p * t), -np.sin(q * t)], axis=1) / 5.0

    def place(t, v):
        x, ahead = middle(t), middle(t + 1e-4) - middle(t - 1e-4)
        along = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        side = np.cross(along, x)
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        return x + thickness / 2 * (np.cos(v)[:, None] * side + np.sin(v)[:, None] * np.cross(along, side))

    return _grid(300, 16, place)


def klein_bottle():
    """Make a Klein bottle by rotating a figure eight by half a turn along a circle."""

    def place(u, v):
        r = 0.35 + 0.15 * (np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v))
        z = 0.15 * (np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v))
        return np.stack([r * np.cos(u), r * np.sin(u), z], axis=1)

    return _grid(80, 40, place, twisted=True)


def letter():
    """Make the letter E from overlapping bars."""
    stem = trimesh.creation.box((0.2, 0.15, 1.0))
    bars = [
        trimesh.creation.box((0.6, 0.15, 0.16)).apply_translation((0.25, 0, z)) for z in (-0.42, 0.0, 0.42)
    ]
    return joined(stem, *bars)


def star():
    """Make a prism with ten sharp corners."""
    angles = np.arange(10) * np.pi / 5
    radii = np.where(np.arange(10) % 2 == 0, 0.5, 0.2)
    rim = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    low, high = (np.column_stack([np.vstack([rim, [0, 0]]), np.full(11, z)]) for z in (-0.1, 0.1))
    i, j = np.arange(10), (np.arange(10) + 1) % 10
    faces = [np.stack([np.full(10, 10), j, i], axis=1), np.stack([np.full(10, 21), i + 11, j + 11], axis=1)]
    faces += [np.stack([i, j, j + 11], axis=1), np.stack([i, j + 11, i + 11], axis=1)]
    return trimesh.Trimesh(np.vstack([low, high]), np.concatenate(faces), process=False)


def scan():
    """Make slightly displaced triangles that share no vertices. One triangle in thirty is missing."""
    mesh = without(ball(0.5, 4), 0.03)
    mesh.unmerge_vertices()
    noise = np.random.default_rng(1).normal(scale=0.002, size=mesh.vertices.shape)
    return trimesh.Trimesh(mesh.vertices + noise, mesh.faces, process=False)


def with_hole():
    mesh = ball(0.5, 4)
    return with_triangles(mesh, mesh.faces[mesh.triangles_center[:, 0] < 0.4])


def with_rubbish():
    """Make a mesh with duplicate triangles, degenerate triangles, and an unused vertex."""
    mesh = ball(0.5)
    faces = [mesh.faces, mesh.faces[:40], [[0, 0, 0], [1, 1, 2]]]
    return trimesh.Trimesh(np.vstack([mesh.vertices, [[0.1, 0.1, 0.1]]]), np.vstack(faces), process=False)


def crossed():
    """Make two boxes that share an edge, and a wall through both boxes."""
    left, right = trimesh.creation.box((0.4, 0.4, 0.8)), trimesh.creation.box((0.4, 0.4, 0.8))
    wall = with_triangles(trimesh.creation.box((0.7, 0.7, 0.7)), [[0, 1, 3], [0, 3, 2]])
    return joined(left, right.apply_translation((0.4, 0.4, 0)), wall)


def random_triangles():
    places = np.random.default_rng(2).uniform(-0.5, 0.5, (300, 1, 3))
    corners = places + np.random.default_rng(3).normal(scale=0.02, size=(300, 3, 3))
    return trimesh.Trimesh(corners.reshape(-1, 3), np.arange(900).reshape(-1, 3), process=False)


BODIES = {
    "hole": with_hole(),
    "non-manifold": crossed(),
    "crosses itself": joined(turned(trimesh.creation.torus(0.35, 0.12)), trimesh.creation.torus(0.3, 0.12)),
    "three parts": joined(ball(0.2), ball(0.2, at=(0.4, 0, 0)), ball(0.2, at=(0.9, 0, 0))),
    "nested shells": joined(ball(0.5), ball(0.3), ball(0.1)),
    "thin sheet": turned(trimesh.creation.box((1.0, 1.0, 0.01))),
    "needle": turned(trimesh.creation.box((1.0, 0.03, 0.03))),
    "300,000 triangles": ball(0.5, 7),
    "noisy scan": scan(),
    "inside out": with_triangles(ball(0.5), ball(0.5).faces[:, ::-1]),
    "degenerate and duplicate": with_rubbish(),
    "a tenth turned round": with_some_turned(ball(0.5), 0.1),
    "part of no area": joined(ball(0.5), with_triangles(ball(0.8), [[0, 1, 2], [0, 2, 1]])),
    "torus knot": torus_knot(),
    "letter": letter(),
    "star": star(),
    "Klein bottle": klein_bottle(),
}
"""Surfaces that become bodies, by name."""

SCALED = {0.001: ball(0.0005), 1000.0: ball(500.0)}
"""Balls by scale."""

REFUSED = {
    "single triangle": trimesh.Trimesh(np.eye(3), [[0, 1, 2]], process=False),
    "two-sided sheet": trimesh.Trimesh(np.eye(3), [[0, 1, 2], [0, 2, 1]], process=False),
    "random triangles": random_triangles(),
}
"""Surfaces that enclose no volume and are refused, by name."""
