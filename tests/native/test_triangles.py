"""Orientation of triangles for each engine: clockwise from outside if the axes are left-handed."""

import numpy as np
import pytest
from library import in_process

pytestmark = pytest.mark.soak

DRAWN = """
from ctypes import Structure
class Info(Structure):
    _fields_ = [("struct_size", c_uint32)] + [(f"row{i}", c_int32) for i in range(4)]
scene = soft.load(arguments[0])
world = soft.create(scene)
info = Info(20)
soft.call("ts_mesh_get_info", scene, c_int32(0), byref(info))
vertices, triangles = info.row1, info.row2
indices = (c_uint32 * (3 * triangles))()
soft.call("ts_mesh_get_triangles", scene, c_int32(0), indices, c_size_t(3 * triangles))
rows, normals = (c_float * (3 * vertices))(), (c_float * (3 * vertices))()
body = soft.body(world, 0)
soft.call("ts_body_mesh", world, body, c_int32(0), rows, normals, c_size_t(3 * vertices))
print(json.dumps([list(indices), list(rows), list(normals)]))
"""


@pytest.mark.parametrize("axes", ["z-up", "y-up", "unity", "unreal"])
def test_the_cross_product_of_two_edges_points_outwards_in_all_axes(axes, native, export):
    """By numbers: with left-handed axes that is clockwise to the eye, with right-handed ones it is not."""
    folder = export("heap") if axes == "z-up" else export("heap", "--axes", axes)
    triangles, rows, normals = (np.reshape(each, (-1, 3)) for each in in_process(native, DRAWN, folder))
    a, b, c = (rows[triangles[:, k]] for k in range(3))
    outward = np.sum(np.cross(b - a, c - a) * normals[triangles[:, 0]], axis=1)
    assert np.all(outward > 0)
    middle = rows.mean(axis=0)
    assert np.all(np.sum((a - middle) * normals[triangles[:, 0]], axis=1) > 0)  # normals, too
