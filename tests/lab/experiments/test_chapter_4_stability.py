"""Steps and planes of the laws of chapter 4: closed forms, and verdicts that depend on the numbers."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Verdict
from lab.experiments.anisotropy import mesh_of
from lab.experiments.law_stability import ShakenBody, vibration
from taichi_soft import Material, box, load_mesh
from taichi_soft.core.package_data import ASSETS

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


def ring_and_fit(mesh, e):
    """Angle [degrees] between edge `e` and the plane that numpy fits to the particles round it."""
    p, q = mesh.edges[e]
    around = {int(v) for tet in mesh.tets if p in tet and q in tet for v in tet} - {int(p), int(q)}
    points = mesh.vertices[sorted(around)]
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0))
    d = mesh.vertices[q] - mesh.vertices[p]
    cosine = abs(axes[2] @ d) / np.linalg.norm(d)
    return len(around), np.degrees(np.arccos(min(cosine, 1.0))), sizes


def test_angles_of_best_fitting_planes_are_numpys():
    results = quick_results("fig-4.7")
    mesh = mesh_of("uneven block", 4)
    found = [ring_and_fit(mesh, e) for e in range(len(mesh.edges))]
    angles = [angle for count, angle, _ in found if count > 2]
    numbers = results.one(mesh="uneven block")
    expected = np.percentile(angles, (5, 25, 50, 75, 95))
    np.testing.assert_allclose(numbers["best_fitting_plane"]["percentiles"], expected, atol=0.1)
    counts = dict(zip(numbers["sizes"], numbers["counts"], strict=True))
    assert counts == {n: sum(count == n for count, _, _ in found) for n in counts}
    beam = load_mesh(ASSETS / "beam_with_hole.npz")
    assert len(mesh_of("beam with hole", 4).vertices) == len(beam.vertices)
    found = verdicts("fig-4.7", results)
    assert found["best-fitting-plane-angles"] is Verdict.AGREES

    def straight(point, numbers):
        return {**numbers, "best_fitting_plane": {**numbers["best_fitting_plane"], "far": 0.0}}

    changed = verdicts("fig-4.7", altered(results, straight))
    assert changed["best-fitting-plane-angles"] is Verdict.DIFFERS


def test_split_rings_are_judged_by_their_angle_to_the_fitted_normals():
    results = quick_results("fig-4.7")
    for name in ("beam with hole", "uneven block"):
        numbers = results.one(mesh=name)
        assert 1.0 < numbers["between"][1] < 15.0
        assert numbers["apart"] > 0.05
    assert results.one(mesh="block")["between"][3] < 1e-3  # even rings: both normals are the edge
    assert verdicts("fig-4.7", results)["split-ring-normal"] is Verdict.PARTLY

    def apart(share):
        return verdicts("fig-4.7", altered(results, lambda _, numbers: {**numbers, "apart": share}))

    assert apart(0.05)["split-ring-normal"] is Verdict.AGREES
    assert apart(0.2)["split-ring-normal"] is Verdict.DIFFERS


def test_a_tilted_plane_follows_an_eighth_or_all_of_a_shear():
    """By hand: each particle adds c times its angle, about an axis across its own arm."""
    results = quick_results("tilted-plane")
    turns = np.radians([0.0, 40.0, 130.0, 170.0, 260.0])
    gaps = np.diff(np.append(turns, turns[0] + 2 * np.pi))
    beta = (gaps + np.roll(gaps, 1)) / 2
    for law, c in (("tilted_plane", beta / np.pi), ("tilted_plane_printed", beta / (8 * np.pi))):
        for size in (4, 6, 7):
            tilt = results.one(law=law, ring=f"{size} even")["tilt"][0]
            assert tilt == pytest.approx(0.01 if law == "tilted_plane" else 0.00125, rel=1e-4)
        angle = 0.01 * (np.cos(turns) - np.cos(turns).mean())  # over the plane in their mean height
        uneven = results.one(law=law, ring="5 uneven")
        assert uneven["tilt"][0] == pytest.approx(np.sum(c * angle * np.cos(turns)), rel=1e-3)
        assert abs(uneven["aside"][0]) == pytest.approx(abs(np.sum(c * angle * np.sin(turns))), rel=1e-3)
    assert verdicts("tilted-plane", results) == {"tilted-plane": Verdict.DIFFERS}

    def corrected(point, numbers):
        return results.one(law="tilted_plane", ring=point["ring"])

    assert verdicts("tilted-plane", altered(results, corrected)) == {"tilted-plane": Verdict.AGREES}


def test_running_finds_the_step_of_the_highest_frequency():
    """For CMPM on a lattice, the largest step is 2 / w. Far above this step, no body is stable."""
    mesh = box((1.0, 1.0, 1.0), (3, 3, 3))
    material = Material(1e6, 0.25, 1000.0, 5.0)
    limit = 2 / vibration(mesh, Material(1e6, 0.25, 1000.0), "cmpm").frequency
    shaken = ShakenBody(mesh, material, "cmpm")
    assert not shaken.stays(1.2 * limit)
    assert shaken.stays(0.5 * limit)
    assert shaken.largest_step() == pytest.approx(limit, rel=0.05)


def test_steps_and_growth_of_cmpm2():
    results = quick_results("cmpm2-step")
    for law in ("cmpm", "cmpm2"):
        for mesh in ("block", "ball"):
            numbers = results.one(law=law, mesh=mesh)
            assert 0.8 * numbers["undamped"] < numbers["run"] < 1.02 * numbers["undamped"]
    assert results.one(law="cmpm2", mesh="another uneven block")["run"] == 0
    assert verdicts("cmpm2-step", results) == {"cmpm2-step": Verdict.DIFFERS}
    assert findings("cmpm2-step", results)["cmpm2-step"].why

    def longer(point, numbers):
        if point["law"] == "cmpm":
            return numbers
        other = results.one(law="cmpm", mesh=point["mesh"])
        return {**numbers, "undamped": 1.1 * other["undamped"], "run": 1.1 * other["run"]}

    assert verdicts("cmpm2-step", altered(results, longer)) == {"cmpm2-step": Verdict.AGREES}
