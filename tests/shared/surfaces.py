"""Surfaces for tests of cages, with known properties of the solids that they enclose."""

import numpy as np
import trimesh

TURN = trimesh.transformations.rotation_matrix(0.5, (1.0, 2.0, 3.0))


def turned(mesh):
    """Rotate a mesh so that it is aligned with no axis."""
    return mesh.copy().apply_transform(TURN)


def ball(radius=1.0, subdivisions=3, at=(0.0, 0.0, 0.0)):
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius).apply_translation(at)


def joined(*meshes):
    """Return one mesh with the triangles of all meshes."""
    return trimesh.util.concatenate(list(meshes))


def with_triangles(mesh, triangles):
    return trimesh.Trimesh(mesh.vertices, triangles, process=False)


def without(mesh, share, seed=0):
    """Remove a fraction of the triangles at random."""
    kept = np.random.default_rng(seed).random(len(mesh.faces)) >= share
    return with_triangles(mesh, mesh.faces[kept])


def with_some_turned(mesh, share, seed=0):
    """Reverse the orientation of a fraction of the triangles."""
    faces = mesh.faces.copy()
    chosen = np.random.default_rng(seed).random(len(faces)) < share
    faces[chosen] = faces[chosen][:, ::-1]
    return with_triangles(mesh, faces)


def lens_volume(radius, apart):
    """Return the volume of the intersection of two equal balls (Weisstein, "Sphere-Sphere Intersection")."""
    return np.pi * (4 * radius + apart) * (2 * radius - apart) ** 2 / 12
