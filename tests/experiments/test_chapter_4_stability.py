"""Steps, costs and planes of the laws of chapter 4: against closed forms, and verdicts that can turn."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from taichi_soft import Material, box, load_mesh
from taichi_soft.experiments import Effort, Verdict
from taichi_soft.experiments.anisotropy import mesh_of
from taichi_soft.experiments.cmpm_drop import FRAME, FRAMES
from taichi_soft.experiments.fig_4_7 import body
from taichi_soft.experiments.implicit_step import points
from taichi_soft.experiments.law_stability import largest_step, stays, vibration
from taichi_soft.stages import ASSETS


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
    assert len(body("beam with hole", 4).vertices) == len(load_mesh(ASSETS / "beam_with_hole.npz").vertices)
    assert verdicts("fig-4.7", results) == {"best-fitting-plane-angles": Verdict.AGREES}

    def straight(point, numbers):
        return {**numbers, "best_fitting_plane": {**numbers["best_fitting_plane"], "far": 0.0}}

    assert verdicts("fig-4.7", altered(results, straight)) == {"best-fitting-plane-angles": Verdict.DIFFERS}


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
    """Of CMPM on a lattice, 2 / w; and a body is not stable far above it."""
    mesh = box((1.0, 1.0, 1.0), (3, 3, 3))
    material = Material(1e6, 0.25, 1000.0, 5.0)
    limit = 2 / vibration(mesh, Material(1e6, 0.25, 1000.0), "cmpm").frequency
    assert stays(mesh, material, "cmpm", 0.5 * limit)
    assert not stays(mesh, material, "cmpm", 1.2 * limit)
    assert largest_step(mesh, material, "cmpm", limit) == pytest.approx(limit, rel=0.05)


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


def test_the_best_fitting_plane_is_judged_by_time_step_and_growth():
    results = quick_results("best-fitting-plane-cost")
    numbers = results.one(mesh="another uneven block")
    assert numbers["growth_rate"]["best_fitting_plane"] > 50 * numbers["growth_rate"]["cmpm"]
    assert all(n["step"]["best_fitting_plane"] < n["step"]["cmpm"] for _, n in results.where())

    def judged(ratio, step):
        def change(point, numbers):
            return {**numbers, "ratio": ratio, "step": {"cmpm": 1.0, "best_fitting_plane": step}}

        return verdicts("best-fitting-plane-cost", altered(results, change))["best-fitting-plane-cost"]

    assert judged(5.0, 0.8) is Verdict.AGREES
    assert judged(0.9, 0.8) is Verdict.DIFFERS
    assert judged(5.0, 1.1) is Verdict.DIFFERS


def test_implicit_steps_follow_a_fall_that_leapfrog_cannot_make():
    """Free fall by implicit Euler is z0 - g h^2 n (n + 1) / 2, by leapfrog z0 - g t^2 / 2."""
    results = quick_results("implicit-step")
    g, t = 9.80665, FRAME * np.arange(1, 5)
    leapfrog = results.one(integrator="leapfrog", factor=0.9)
    np.testing.assert_allclose(leapfrog["height"][:4], 1.5 - g * t**2 / 2, atol=1e-3)
    implicit = results.one(integrator="implicit_euler", run="fall", factor=100.0)
    n = np.round(t / implicit["step"])
    np.testing.assert_allclose(
        implicit["height"][:4], 1.5 - g * implicit["step"] ** 2 * n * (n + 1) / 2, atol=1e-3
    )
    assert implicit["step"] == pytest.approx(1e-2, rel=0.05)
    assert results.one(integrator="leapfrog", factor=1.3)["frozen"]
    assert len(results.one(run="rates")["explicit"]) == FRAMES
    assert verdicts("implicit-step", results)["implicit-step"] is Verdict.AGREES

    def judged(gain, frozen):
        def change(point, numbers):
            if point["run"] == "rates":
                return {"explicit": [gain] * FRAMES, "implicit": [1.0] * FRAMES}
            return {**numbers, "frozen": frozen if point["factor"] == 100.0 else numbers["frozen"]}

        return list(verdicts("implicit-step", altered(results, change)).values())

    assert judged(25.0, False) == [Verdict.AGREES, Verdict.AGREES]
    assert judged(5.0, True) == [Verdict.DIFFERS, Verdict.DIFFERS]
    assert {point["resolution"] for point in points(Effort.FULL)} == {5}
