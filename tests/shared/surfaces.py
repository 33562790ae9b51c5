"""Surfaces to make cages of, with what is known of the solids in them."""

import numpy as np
import trimesh

TURN = trimesh.transformations.rotation_matrix(0.5, (1.0, 2.0, 3.0))


def turned(mesh):
    """Along no axis."""
    return mesh.copy().apply_transform(TURN)


def ball(radius=1.0, subdivisions=3, at=(0.0, 0.0, 0.0)):
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius).apply_translation(at)


def joined(*meshes):
    """One mesh with the triangles of all."""
    return trimesh.util.concatenate(list(meshes))


def with_triangles(mesh, triangles):
    return trimesh.Trimesh(mesh.vertices, triangles, process=False)


def without(mesh, share, seed=0):
    """Lacking a share of its triangles."""
    kept = np.random.default_rng(seed).random(len(mesh.faces)) >= share
    return with_triangles(mesh, mesh.faces[kept])


def with_some_turned(mesh, share, seed=0):
    """A share of the triangles face the other way."""
    faces = mesh.faces.copy()
    chosen = np.random.default_rng(seed).random(len(faces)) < share
    faces[chosen] = faces[chosen][:, ::-1]
    return with_triangles(mesh, faces)


def lens_volume(radius, apart):
    """Of what two equal balls share (Weisstein, "Sphere-Sphere Intersection")."""
    return np.pi * (4 * radius + apart) * (2 * radius - apart) ** 2 / 12
