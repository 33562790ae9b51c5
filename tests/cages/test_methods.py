"""External meshers: their meshes, and their crashes, which raise an error and do no other harm."""

import inspect
import logging
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from surfaces import ball, joined, lens_volume, turned, with_some_turned, without

from taichi_soft import (
    Material,
    MeshError,
    MissingExtraError,
    OptionError,
    SoftBodyAsset,
    TetMesh,
    load_mesh,
    save_mesh,
)
from taichi_soft.cages import mesher_process, tetrahedra_of
from taichi_soft.cages.mesher import winding_number
from taichi_soft.core.extras import missing_packages
from taichi_soft.meshing.surfaces import read_surfaces
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

JELLY = Material(young=2e5, poisson=0.3, density=1000.0, damping_ratio=0.2)
CELLS = 6


def needing(*methods):
    """Return parameters that are skipped, with a message, if the package of the method is missing."""
    return [
        pytest.param(
            method,
            marks=pytest.mark.skipif(
                bool(missing_packages(method)),
                reason=f"needs {', '.join(missing_packages(method))}: pip install 'taichi-soft[{method}]'",
            ),
        )
        for method in methods
    ]


both = pytest.mark.parametrize("method", needing("tetgen", "ftetwild"))
by_tetgen = pytest.mark.parametrize("method", needing("tetgen"))
by_ftetwild = pytest.mark.parametrize("method", needing("ftetwild"))


def meshed(surface, method, **options):
    return tetrahedra_of(read_surfaces(surface), method=method, **(options or {"cells": CELLS}))[0]


def volume_of(mesh):
    """Return the volume inside closed triangles, by the divergence theorem."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def volumes_of(mesh):
    """Return the signed volumes of tetrahedra."""
    x = mesh.vertices[mesh.tets]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6.0


def distances(points, surface):
    """Return the distances of points from their nearest triangle."""
    corners = surface.vertices[surface.faces]
    found = np.empty(len(points))
    for i, point in enumerate(points):
        nearest = trimesh.triangles.closest_point(corners, np.tile(point, (len(corners), 1)))
        found[i] = np.linalg.norm(nearest - point, axis=1).min()
    return found


def part_count(tets):
    owner = np.arange(tets.max() + 1)
    while True:  # the smallest number spreads over each tetrahedron
        before = owner.copy()
        np.minimum.at(owner, tets.ravel(), np.repeat(owner[tets].min(axis=1), 4))
        if (owner == before).all():
            return len(np.unique(owner))


SHAPES = {"ball": ball(), "torus": turned(trimesh.creation.torus(1.0, 0.4)).apply_translation((40, -7, 3))}
SLACK = {"tetgen": 1e-9, "ftetwild": 0.05}
"""By method: how far its outer faces may be from the surface, in cells."""


@pytest.mark.guard
@pytest.mark.parametrize("shape", SHAPES)
@both
def test_it_fills_the_polyhedron_and_its_outer_vertices_lie_on_it(method, shape):
    surface = SHAPES[shape]
    mesh = meshed(surface, method)
    slack = SLACK[method] * np.ptp(surface.vertices, axis=0).max() / CELLS
    assert type(mesh) is TetMesh
    assert volumes_of(mesh).min() > 0.0
    assert volumes_of(mesh).sum() == pytest.approx(volume_of(surface), abs=surface.area * slack)
    assert distances(mesh.vertices[mesh.surface_vertices], surface).max() < 1.01 * slack + 1e-12
    assert (mesh.fill == 1.0).all()
    assert part_count(mesh.tets) == 1


@by_tetgen
def test_tetgen_keeps_every_vertex_and_makes_the_same_on_every_run(method):
    surface = SHAPES["ball"]
    first, second = meshed(surface, method), meshed(surface, method)
    own = {tuple(row) for row in np.round(first.vertices, 9)}
    assert {tuple(row) for row in np.round(surface.vertices, 9)} <= own
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.tets.tobytes() == second.tets.tobytes()


@both
def test_cells_are_as_long_as_with_a_lattice(method):
    """The surface is smooth and needs no shorter edges. A lattice has edges of 1 and 0.87 cells."""
    for options in ({"cells": 10}, {"cell_size": 0.3}):
        cell = options.get("cell_size", 0.2)
        edge = np.median(meshed(ball(subdivisions=2), method, **options).edge_lengths)
        assert 0.8 * cell < edge < 1.15 * cell


@both
def test_copies_of_vertices_and_of_triangles_count_once(method):
    soup = ball(subdivisions=2)
    soup.unmerge_vertices()
    faces = np.vstack([soup.faces, soup.faces[:5], [[0, 0, 1]]])
    soup = trimesh.Trimesh(np.vstack([soup.vertices, [[9, 9, 9]]]), faces, process=False)
    mesh = meshed((soup.vertices, soup.faces), method, cell_size=0.4)
    exact = volume_of(ball(subdivisions=2))
    assert volumes_of(mesh).sum() == pytest.approx(exact, rel=1e-9 if method == "tetgen" else 0.02)


@both
def test_a_cavity_stays_empty_and_a_ball_within_a_ball_is_solid(method):
    shell = ball(0.5, 2)
    shell.invert()
    outer, inner = volume_of(ball(subdivisions=2)), volume_of(ball(0.5, 2))
    close = 1e-9 if method == "tetgen" else 0.03
    hollow = meshed(joined(ball(subdivisions=2), shell), method)
    assert volumes_of(hollow).sum() == pytest.approx(outer - inner, rel=close)
    nested = meshed(joined(ball(subdivisions=2), ball(0.5, 2)), method)
    assert volumes_of(nested).sum() == pytest.approx(outer, rel=close)


@both
def test_parts_that_do_not_touch_stay_apart(method):
    mesh = meshed(joined(ball(subdivisions=2), ball(subdivisions=2, at=(2.5, 0, 0))), method)
    assert part_count(mesh.tets) == 2
    assert volumes_of(mesh).sum() == pytest.approx(2 * volume_of(ball(subdivisions=2)), rel=0.03)


@by_ftetwild
def test_ftetwild_takes_holes_turned_triangles_and_parts_that_overlap(method):
    whole = ball(subdivisions=2)
    exact = volume_of(whole)
    assert meshed(without(whole, 0.02), method).volume == pytest.approx(exact, rel=0.05)
    assert meshed(with_some_turned(whole, 0.1), method).volume == pytest.approx(exact, rel=0.05)
    two = meshed(joined(whole, ball(subdivisions=2, at=(1.5, 0, 0))), method)
    shared = lens_volume(1.0, 1.5)  # of true balls; these are 5 % smaller
    assert two.volume == pytest.approx(2 * exact - shared, rel=0.05)


@by_tetgen
def test_tetgen_refuses_what_is_open_or_crosses_itself_with_the_way_out(method):
    for surface in (without(ball(), 0.02), joined(ball(), ball(at=(1.5, 0, 0)))):
        with pytest.raises(MeshError, match=r"'tetgen'.*method='lattice'"):
            meshed(surface, method)


@both
def test_a_body_of_it_falls_and_rests_and_is_drawn_as_the_artist_made_it(method, tmp_path):
    """The tetrahedra come from a mesher or from a file."""
    surface = trimesh.creation.box((0.8, 0.6, 0.5))
    asset = SoftBodyAsset.from_surface(surface, JELLY, cells=4, method=method)
    save_mesh(asset.mesh, tmp_path / "block.npz")
    again = SoftBodyAsset(load_mesh(tmp_path / "block.npz"), JELLY, skin=surface)
    above = 0.05 - surface.bounds[0][2]
    world = bare_world()
    bodies = [world.add_body(each, position=(2 * i, 0, above)) for i, each in enumerate((asset, again))]
    world.build()
    for i, body in enumerate(bodies):
        drawn, _ = world.read_render_mesh(body.render_meshes[0], 1.0)
        np.testing.assert_allclose(drawn - [2 * i, 0, above], surface.vertices, atol=1e-5)
    for _ in range(150):
        world.step(1 / 60)
    for body in bodies:
        lowest = world.read_render_mesh(body.render_meshes[0], 1.0)[0][:, 2].min()
        assert lowest == pytest.approx(0.0, abs=0.03)
        assert np.abs(body.velocities()).max() < 0.1
        assert body.flipped_count() == 0
        assert not body.is_frozen
    masses = [body.asset.description.masses.sum() for body in bodies]
    assert masses == pytest.approx([1000 * volume_of(surface)] * 2, rel=0.03)


@by_tetgen
def test_another_skin_is_drawn_in_place_of_a_coarse_surface(method):
    asset = SoftBodyAsset.from_surface(ball(subdivisions=1), JELLY, method=method, cells=3, skin=ball())
    assert asset.skins[0].vertex_count == len(ball().vertices)


@by_tetgen
def test_short_steps_are_logged_with_the_way_out(method, caplog):
    with caplog.at_level(logging.WARNING, "taichi_soft"):
        SoftBodyAsset.from_surface(ball(subdivisions=2), JELLY, cells=6, method=method)
        assert caplog.messages == []
        fine = trimesh.creation.box((1, 1, 1))
        fine.vertices[0] *= 0.99
        fine = joined(fine.subdivide(), ball(0.02, 1, at=(2.0, 0, 0)))
        SoftBodyAsset.from_surface(fine, JELLY, cells=6, method=method)
    (message,) = caplog.messages
    assert "times shorter than with a lattice" in message
    assert "dihedral angles" in message


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"method": "voxels"}, "'lattice', 'tetgen', 'ftetwild'"),
        ({"method": "lattice", "time_limit": 5.0}, "time_limit=5.*leave it out"),
        ({"method": "tetgen", "time_limit": 0.0}, "time_limit"),
        ({"method": "tetgen", "cells": 1000}, "GiB"),
        ({"method": "ftetwild", "cells": 5, "cell_size": 0.1}, "one of them"),
        ({"method": "ftetwild", "cell_size": 9.0}, "cell_size=9 m.*reduce it"),
    ],
)
def test_options_out_of_range_are_refused_before_anything_runs(options, text):
    with pytest.raises(OptionError, match=text):
        SoftBodyAsset.from_surface(ball(), JELLY, **options)


@pytest.mark.parametrize(
    "surface", [([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 1]]), ([[1, 1, 1]] * 3, [[0, 1, 2]])]
)
@both
def test_a_surface_without_triangles_is_refused(method, surface):
    with pytest.raises(MeshError, match="encloses nothing"):
        meshed(surface, method)


def test_a_missing_package_is_one_line_with_its_extra(monkeypatch):
    monkeypatch.setattr("taichi_soft.core.extras.find_spec", lambda name: None)
    for method, package in (("tetgen", "tetgen"), ("ftetwild", "pytetwild")):
        way = rf"method '{method}' needs {package}.*pip install 'taichi-soft\[{method}\]'"
        with pytest.raises(MissingExtraError, match=way):
            meshed(ball(), method)


def test_a_frozen_program_is_told_to_ship_the_mesh(fake, monkeypatch):
    fake("raise AssertionError('started')")
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    with pytest.raises(MeshError, match="save_mesh"):
        meshed(ball(), "tetgen")


def test_winding_numbers_are_those_of_nested_balls():
    surface = joined(ball(2.0), ball(1.0))
    corners = surface.vertices[surface.faces]
    for point, times in (([0.1, 0.2, 0.0], 2.0), ([0.0, 1.5, 0.0], 1.0), ([0.0, 0.0, 3.0], 0.0)):
        assert winding_number(np.array(point), corners) == pytest.approx(times, abs=1e-9)


# What goes wrong in the process, with a package of the mesher's name that does it.

HOLD = "import ctypes; ctypes.PyDLL(None).sleep(600)"
"""C code that never gives the interpreter back, as a mesher is."""

RESULT = """
class TetGen:
    def __init__(self, *surface): pass
    def tetrahedralize(self, switches):
        return RESULT
"""

BROKEN = {
    "a crash": ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "ended by SIGSEGV"),
    "an abort": ("import os; os.abort()", "ended by SIGABRT"),
    "an early end": ("import os; os._exit(7)", "ended with 7"),
    "an exception": ("raise RuntimeError('facets\\n\\n  3 and 5 cross')", "3 and 5 cross"),
    "no result": ("import os; os._exit(0)", "cannot be read"),
    "half a file": (
        "open('tetrahedra.npz', 'wb').write(b'PK\\3\\4 x'); import os; os._exit(0)",
        "cannot be read",
    ),
    "another file": ("import numpy as n; n.savez('tetrahedra.npz', a=1); import os; os._exit(0)", "no valid"),
    "an object": (RESULT.replace("RESULT", "[object()], [[0, 1, 2, 3]], [[0]], 0"), "cannot be read"),
    "no numbers": (
        RESULT.replace("RESULT", "[[float('nan')] * 3] * 4, [[0, 1, 2, 3]], [[0]], 0"),
        "no valid",
    ),
    "no vertices": (RESULT.replace("RESULT", "[[0., 0, 0]] * 4, [[0, 1, 2, 9]], [[0]], 0"), "no valid"),
    "flat ones": (RESULT.replace("RESULT", "[[0., 0, 0]] * 4, [[0, 1, 2, 3]], [[0]], 0"), "no volume"),
    "words": (RESULT.replace("RESULT", "['a'] * 4, ['bcde'], [[0]], 0"), "no valid"),
    "none": (
        RESULT.replace("RESULT", "[[0., 0, 0]], __import__('numpy').zeros((0, 4), int), [], 0"),
        "nothing within",
    ),
}


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """Return a function that replaces TetGen by Python code."""
    folder, scratch = tmp_path / "packages", tmp_path / "scratch"
    folder.mkdir()
    scratch.mkdir()
    number = tmp_path / "number"
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))

    def put(code):
        begin = f"import os, sys; open({str(number)!r}, 'w').write(str(os.getpid()))\n"
        (folder / "tetgen.py").write_text(begin + code + "\n", encoding="utf-8")
        monkeypatch.syspath_prepend(str(folder))
        return lambda: int(number.read_text())

    yield put
    assert list(scratch.iterdir()) == []


def is_running(number):
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True


posix = pytest.mark.skipif(os.name == "nt", reason="signals, as POSIX has them")


@posix
@pytest.mark.parametrize("what", BROKEN)
def test_what_breaks_in_the_process_is_an_error_and_nothing_is_left(fake, what, capfd):
    code, text = BROKEN[what]
    number = fake(code)
    with pytest.raises(MeshError, match=text) as caught:
        meshed(ball(subdivisions=1), "tetgen")
    assert "method 'tetgen'" in str(caught.value)
    assert "method='lattice'" in str(caught.value)
    assert not is_running(number())
    assert capfd.readouterr() == ("", "")


@posix
@pytest.mark.parametrize("code", [HOLD, "while True: print('x' * 1000)"])
def test_what_hangs_is_ended_at_its_limit(fake, code):
    number = fake(code)
    with pytest.raises(MeshError, match=r"1\.5 s .*time_limit.*method='lattice'"):
        meshed(ball(subdivisions=1), "tetgen", cells=CELLS, time_limit=1.5)
    assert not is_running(number())


@posix
def test_ctrl_c_ends_the_process_too(fake, monkeypatch):
    number = fake(HOLD)

    def interrupted(*_, **__):
        number = Path(tempfile.tempdir).parent / "number"
        while not (number.exists() and number.read_text()):
            time.sleep(0.01)
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess.Popen, "communicate", interrupted)
    with pytest.raises(KeyboardInterrupt):
        meshed(ball(subdivisions=1), "tetgen")
    assert not is_running(number())


@posix
def test_a_process_ends_by_itself_where_nobody_is_left_to_end_it(fake, tmp_path):
    fake(HOLD)
    surface = ball(subdivisions=1)
    np.savez(tmp_path / "surface.npz", vertices=surface.vertices, triangles=surface.faces, cell_size=0.3)
    code = inspect.getsource(mesher_process)
    done = subprocess.run(
        [sys.executable, "-c", code, "tetgen", "1", *sys.path], cwd=tmp_path, capture_output=True, timeout=60
    )
    assert done.returncode == 1
    assert b"Timeout" in done.stderr


def test_the_process_starts_no_taichi(fake):
    seen = "print(sorted(n for n in sys.modules if n.startswith('taichi')), file=sys.stderr); os._exit(3)"
    fake(seen)
    with pytest.raises(MeshError, match=r"ended with 3: '\[\]'"):
        meshed(ball(subdivisions=1), "tetgen")
