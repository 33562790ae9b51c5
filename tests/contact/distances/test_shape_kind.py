"""Classification of solids as convex, by the distances that kernels compute."""

import numpy as np
import pytest
import trimesh

from taichi_soft import BoxShape, CapsuleShape, HeightFieldShape, MeshShape, PlaneShape, SphereShape
from taichi_soft.contact.distances.shape_kind import CONVEX, ShapeKind

pytestmark = pytest.mark.kernel

RING = trimesh.creation.torus(0.8, 0.25, 16, 10)
STAIRS = np.where(np.indices((9, 9)).sum(axis=0) % 4 < 2, 0.3, 0.0)
SOLIDS = {
    ShapeKind.PLANE: lambda: PlaneShape((3, 0, 4)),
    ShapeKind.SPHERE: lambda: SphereShape(0.7),
    ShapeKind.BOX: lambda: BoxShape((1.0, 0.4, 2.0)),
    ShapeKind.CAPSULE: lambda: CapsuleShape(0.3, 0.8),
    ShapeKind.HEIGHT_FIELD: lambda: HeightFieldShape(STAIRS, 0.4),
    ShapeKind.MESH: lambda: MeshShape(RING, cell=0.05, cache=False),
}
"""A solid of every kind, bent inwards somewhere where its kind lets it be."""


@pytest.mark.parametrize("kind", ShapeKind)
def test_distances_from_a_solid_are_convex_along_chords_where_its_kind_is(kind, measure):
    solid, rng = SOLIDS[kind](), np.random.default_rng(6)
    a, b = rng.uniform(-1.5, 1.5, (2, 20000, 3))
    part = rng.uniform(0, 1, (20000, 1))
    from_a, from_b, between = (measure(solid, x)[0] for x in (a, b, a + part * (b - a)))
    above = between - (from_a + part[:, 0] * (from_b - from_a))
    if kind in CONVEX:
        assert above.max() < 2e-6
    else:
        assert above.max() > 0.1
