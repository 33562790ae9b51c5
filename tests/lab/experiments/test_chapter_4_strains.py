"""Strains of edges and stiffness in all directions, compared with closed forms of uniform deformation."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Verdict
from lab.experiments.anisotropy import mesh_of
from lab.experiments.directional_stiffness import directions
from taichi_soft import Material, voronoi_graph
from taichi_soft.meshing import EdgeRings

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

SHARE = Material(1.0, 0.25, 1.0)
RIGHT = SHARE.lame_lambda + 2 * SHARE.lame_mu


def expected_strains(angle, stretch):
    """Return the strains of a unit edge d whose face deforms with the material: n along F^-T d, r = F d."""
    turn = np.radians(angle)
    d, F = np.array([np.sin(turn), 0, np.cos(turn)]), np.diag([1, 1, 1 + stretch])
    n = np.linalg.solve(F.T, d)
    n /= np.linalg.norm(n)
    return n @ F @ d - 1, np.linalg.norm(np.cross(n, F @ d))


def test_an_edge_reads_what_the_deformation_of_its_face_says():
    results = quick_results("fig-4.3")
    for angle in (0, 30, 60, 90):
        numbers = results.one(angle=angle, poisson=0.25)
        for i, stretch in enumerate((0.01, 0.3)):
            tensile, shear = expected_strains(angle, stretch)
            assert numbers["tensile"][i] == pytest.approx(tensile, abs=1e-7)
            assert numbers["shear"][i] == pytest.approx(shear, abs=1e-7)
        turn = np.radians(angle)
        normal, across = results.one(angle=angle, poisson=0.0)["stress"]
        assert normal == pytest.approx(1e4 * np.cos(turn) ** 2, abs=100)  # Hooke's, nu = 0
        assert across == pytest.approx(1e4 * np.cos(turn) * np.sin(turn), abs=100)
        short = numbers["stress"][0] - 1e4 * (np.cos(turn) ** 2 - 0.25 * np.sin(turn) ** 2)
        assert abs(short) < 150
    assert verdicts("fig-4.3", results) == {"strain-misread-edge": Verdict.DIFFERS}
    assert "25 %" in findings("fig-4.3", results)["strain-misread-edge"].why

    def misread(point, numbers):
        return {**numbers, "shear": [2 * value for value in numbers["shear"]]}

    assert verdicts("fig-4.3", altered(results, misread)) == {"strain-misread-edge": Verdict.AGREES}


def test_a_tetrahedron_is_anisotropic_in_proportion_to_e_less_2_g():
    """Its six edges are the face diagonals of a cube: softest along the axes, stiffest along the corners."""
    results = quick_results("fig-4.5")
    for name, nu in (("nu = 0", 0.0), ("nu = 0.25", 0.25), ("nu = 0.4", 0.4)):
        shear = 1e6 / (2 + 2 * nu)
        for law in ("cmpm", "cmpm2"):
            moduli = results.one(law=law, material=name)["moduli"]
            assert min(moduli) >= 2 * shear + (1e6 - 2 * shear) / 2 - 500
            assert max(moduli) <= 2 * shear + (1e6 - 2 * shear) * 2 / 3 + 500
        virial = results.one(law="virial", material=name)["moduli"]
        wanted = 1e6 * (1 - nu) / (1 + nu) / (1 - 2 * nu)
        np.testing.assert_allclose(virial, wanted, rtol=1e-3)
    assert verdicts("fig-4.5", results)["cmpm-anisotropic"] is Verdict.AGREES

    def even(point, numbers):
        return {**numbers, "moduli": [1.0] * 40} if "law" in point else numbers

    assert verdicts("fig-4.5", altered(results, even))["cmpm-anisotropic"] is Verdict.DIFFERS


def test_an_edge_at_a_pulled_particle_reads_the_strain_in_the_frame_of_its_subface():
    """Eq. 4.8 and 4.9 written out: the subfaces span the centres of the edge, two faces and the body."""
    results = quick_results("fig-4.5")
    for angle in (25.0, 30.0, 45.0):
        b = 1 / np.sqrt(3)
        p, q = np.array([b, 0, 0]), np.array([0, 0, b / np.tan(np.radians(angle))])
        sides = [np.array([-b / 2, side, 0]) for side in (0.5, -0.5)]
        middle = (p + q) / 2
        body = (p + q + sum(sides)) / 4
        faces = [(p + q + side) / 3 for side in sides]
        n = sum(np.cross(a - middle, c - middle) for a, c in ((faces[0], body), (body, faces[1])))
        n *= np.sign(n @ (q - p)) / np.linalg.norm(n)
        numbers = results.one(apex=angle)
        for i, stretch in enumerate((0.01, 0.3, 1.0)):
            F = np.diag([1, 1, 1 + stretch])
            now = np.linalg.solve(F.T, n)
            now /= np.linalg.norm(now)
            assert numbers["tensile"][i] == pytest.approx(now @ F @ n - 1, abs=1e-6)
            assert numbers["shear"][i] == pytest.approx(np.linalg.norm(np.cross(now, F @ n)), abs=1e-6)

    def read(tensile, shear):
        def change(point, numbers):
            return {"tensile": tensile, "shear": shear} if "apex" in point else numbers

        return verdicts("fig-4.5", altered(results, change))["strain-misread-triangle"]

    stretches = np.array([0.01, 0.3, 1.0])
    assert read(0.2 * stretches, 0.9 * stretches) is Verdict.AGREES
    assert read(0.9 * stretches, 0.2 * stretches) is Verdict.DIFFERS
    assert read(0.6 * stretches, 1.3 * stretches) is Verdict.DIFFERS  # that is not small
    assert read(0.2 * stretches, 0.9 * stretches[::-1]) is Verdict.UNKNOWN
    assert verdicts("fig-4.5", results)["strain-misread-triangle"] is Verdict.UNKNOWN


def test_stiffness_is_the_fourth_moment_of_the_edges():
    """CMPM: 2 G + (E - 2 G) sum a l (d.n)^4 / V with Voronoi faces; springs: E times that with subfaces."""
    results = quick_results("anisotropy")
    around = directions(24)

    def moment(mesh, areas):
        ends = mesh.vertices[mesh.edges]
        d = (ends[:, 1] - ends[:, 0]) / mesh.edge_lengths[:, None]
        return ((d @ around.T) ** 4).T @ (areas * mesh.edge_lengths) / mesh.volume

    shear = SHARE.lame_mu
    for name in ("block", "uneven block"):
        mesh = mesh_of(name, 3)
        cmpm = 2 * shear + (1 - 2 * shear) * moment(mesh, voronoi_graph(mesh).areas)
        found = results.one(law="cmpm", mesh=name)["around"]
        np.testing.assert_allclose(found, cmpm / RIGHT, rtol=3e-3)
    mesh = mesh_of("block", 3)
    springs = moment(mesh, EdgeRings.of(mesh).edge_areas)
    np.testing.assert_allclose(results.one(law="springs", mesh="block")["around"], springs / RIGHT, rtol=3e-3)
    for law in ("virial", "st_venant_kirchhoff"):
        np.testing.assert_allclose(results.one(law=law, mesh="block")["around"], 1, rtol=2e-3)
    assert verdicts("anisotropy", results) == {"cmpm2-anisotropic": Verdict.AGREES}

    def even(point, numbers):
        return {**numbers, "around": [1.0] * 24} if point["law"] == "cmpm2" else numbers

    assert verdicts("anisotropy", altered(results, even)) == {"cmpm2-anisotropic": Verdict.DIFFERS}
