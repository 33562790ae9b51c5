"""Stress events, compared with NumPy on the positions after each step."""

import numpy as np
import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    MeshError,
    OptionError,
    SpringMaterial,
    StateError,
    Stiffness,
    StressExceeded,
    TearCandidates,
    box,
    rope,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
STEPS = 40
BEAM = box(cells=(6, 3, 3), size=(2.0, 1.0, 1.0))
WOOD = Stiffness.orthotropic(young=(4e5, 1e5, 5e4), poisson=(0.2, 0.2, 0.2), shear=(6e4, 5e4, 2e4))
STRESS, PULL = 2.0e4, 2.5e4  # [Pa], within the range of stress in the swinging beams
BACK = 0.9


def start(body, seed):
    """Pull a body long, bent and a little out of shape, so that it swings."""
    x = body.positions().astype(float)
    along = x[:, 0] - x[:, 0].mean()
    x[:, 0] += 0.12 * along
    x[:, 2] += 0.08 * along**2
    x += np.random.default_rng(seed).normal(scale=0.01, size=x.shape)
    body.set_motion(x, np.zeros_like(x))


def cauchy_stress(body):
    """Return the stress of the neo-Hookean law, or of the virial law for wood.

    The linear strain of wood rotates with R of F = R U.
    """
    x, rest = body.positions().astype(float)[body.tets], BEAM.vertices[body.tets]
    F = np.stack([np.linalg.solve(r[1:] - r[0], y[1:] - y[0]).T for r, y in zip(rest, x, strict=True)])
    if isinstance(body.material, Material):
        young, nu = 2e5, 0.3
        mu, lam = young / (2 * (1 + nu)), young * nu / ((1 + nu) * (1 - 2 * nu))
        m, l, J = 4 / 3 * mu, lam + 5 / 6 * mu, np.linalg.det(F)[:, None, None]  # noqa: E741
        along = m * (1 - 1 / (np.einsum("mab,mab->m", F, F) + 1))[:, None, None]
        return along / J * (F @ np.swapaxes(F, 1, 2)) + (l * (J - 1) - mu) * np.eye(3)
    strain = 0.5 * (np.swapaxes(F, 1, 2) @ F - np.eye(3))
    e = np.stack([strain[:, i, j] * (1 if i == j else 2) for i, j in VOIGT], axis=1) @ WOOD.matrix.T
    stress = np.empty_like(strain)
    for k, (i, j) in enumerate(VOIGT):
        stress[:, i, j] = stress[:, j, i] = e[:, k]
    left, _, right = np.linalg.svd(F)
    R = left @ right
    return R @ stress @ np.swapaxes(R, 1, 2)


VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def von_mises(body):
    s = cauchy_stress(body)
    xx, yy, zz, yz, xz, xy = (s[:, i, j] for i, j in VOIGT)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (yz**2 + xz**2 + xy**2))


@pytest.fixture(scope="module")
def beams():
    """A world with an isotropic beam, a beam of wood and a rope, swinging."""
    world = bare_world(gravity=(0, 0, 0), floor=None)
    for i, material in enumerate((Material(2e5, 0.3, 1000.0, 5.0), AnisotropicMaterial(WOOD, 1000.0, 5.0))):
        world.add_body(BEAM, material, position=(0, 3 * i, 0))
    world.add_body(rope(1.0, 8, 1.0), SpringMaterial(1e3), law="springs", position=(0, 9, 0))
    world.build()
    return world


@pytest.fixture
def swinging(beams):
    """Return the beams at the start of their swing, without stress events. This state is recorded."""
    for i, body in enumerate(beams.bodies[:2]):
        body.watch_stress(None)
        body.watch_tearing(None)
        start(body, i)
    beams.record_events()
    beams.drain_events()
    return beams


class Watcher:
    """Finds the tetrahedra whose stress exceeds a threshold after each step."""

    def __init__(self, threshold, count):
        self.threshold, self.told = threshold, np.zeros(count, dtype=bool)
        self.unsure = np.zeros(count, dtype=bool)  # too near the threshold, or to what tells them anew

    def see(self, stress):
        for level in (self.threshold, BACK * self.threshold):
            self.unsure |= np.abs(stress - level) < 1e-3 * level
        fresh = (stress > self.threshold) & ~self.told
        self.told = (stress > self.threshold) | (self.told & (stress >= BACK * self.threshold))
        return set(np.flatnonzero(fresh & ~self.unsure).tolist())


def named(event, watcher):
    return set(event.tetrahedra.tolist()) - set(np.flatnonzero(watcher.unsure).tolist())


@pytest.mark.parametrize("index", [0, 1])
def test_tetrahedra_are_named_in_the_step_in_which_they_come_over_the_stress(swinging, index):
    body = swinging.bodies[index]
    body.watch_stress(STRESS)
    watcher = Watcher(STRESS, len(body.tets))
    named_count, again = 0, np.zeros(len(body.tets), dtype=int)
    for _ in range(STEPS):
        swinging.step(DT, 8)
        stress = von_mises(body)
        expected = watcher.see(stress)
        events = swinging.drain_events()
        assert [(type(e), e.body, e.step) for e in events] == [
            (StressExceeded, body, swinging.step_count - 1) for _ in events
        ]
        found = set()
        for event in events:
            assert (np.diff(event.tetrahedra) > 0).all()
            np.testing.assert_allclose(event.stress, stress[event.tetrahedra], rtol=1e-3)
            np.testing.assert_allclose(event.stress, body.tet_stress()[event.tetrahedra], rtol=1e-3)
            found |= named(event, watcher)
            again[event.tetrahedra] += 1
        assert found == expected
        named_count += len(found)
    assert named_count > 50
    assert again.max() > 1, "none swings back and over it again"
    assert watcher.unsure.mean() < 0.2


@pytest.mark.parametrize("index", [0, 1])
def test_tears_are_where_the_largest_principal_stress_pulls_and_across_it(swinging, index):
    body = swinging.bodies[index]
    body.watch_tearing(PULL)
    watcher = Watcher(PULL, len(body.tets))
    named_count = 0
    for _ in range(STEPS):
        swinging.step(DT, 8)
        values, axes = np.linalg.eigh(cauchy_stress(body))
        expected = watcher.see(values[:, 2])
        events = swinging.drain_events()
        assert len(events) <= 1
        found = set()
        for event in events:
            assert type(event) is TearCandidates
            assert event.body is body
            rows = event.tetrahedra
            np.testing.assert_allclose(event.stress, values[rows, 2], rtol=1e-3)
            np.testing.assert_allclose(np.linalg.norm(event.normals, axis=1), 1.0, atol=1e-5)
            cosines = np.abs(np.einsum("ma,ma->m", axes[rows, :, 2], event.normals))
            clear = values[rows, 2] - values[rows, 1] > 0.1 * values[rows, 2]
            assert cosines[clear].min(initial=1.0) > 0.999
            found |= named(event, watcher)
        assert found == expected
        named_count += len(found)
    assert named_count > 50


def test_both_are_watched_at_once_body_by_body_until_they_no_longer_are(swinging):
    one, two, _ = swinging.bodies
    for body in (two, one):
        body.watch_tearing(PULL / 10)
        body.watch_stress(STRESS / 10)
    swinging.step(DT, 8)
    assert [(type(e), e.body) for e in swinging.drain_events()] == [
        (StressExceeded, one),
        (StressExceeded, two),
        (TearCandidates, one),
        (TearCandidates, two),
    ]
    one.watch_stress(STRESS / 10)
    two.watch_stress(None)
    swinging.step(DT, 8)
    again = swinging.drain_events()
    assert (StressExceeded, one) in [(type(e), e.body) for e in again], "a new threshold begins anew"
    assert (StressExceeded, two) not in [(type(e), e.body) for e in again]


def test_who_is_removed_is_no_longer_watched_and_who_comes_is_not(swinging):
    one, two, _ = swinging.bodies
    for body in (one, two):
        body.watch_stress(STRESS / 10)
    swinging.despawn(one)
    new = swinging.spawn(one.asset)
    start(new, 0)
    swinging.step(DT, 8)
    assert [event.body for event in swinging.drain_events()] == [two]


def test_watching_begins_the_recording_of_its_kind_alone(swinging):
    swinging.record_events([])
    swinging.bodies[0].watch_tearing(PULL / 10)
    swinging.bodies[0].watch_stress(None)
    swinging.step(DT, 8)
    assert [type(event) for event in swinging.drain_events()] == [TearCandidates]


def test_a_body_at_rest_turned_and_moved_has_no_stress_to_tell_of(swinging, turned):
    body = swinging.bodies[0]
    body.watch_stress(50.0)
    body.watch_tearing(50.0)
    body.set_motion(BEAM.vertices @ turned.T + 3, np.zeros_like(BEAM.vertices))
    swinging.step(DT, 8)
    assert swinging.drain_events() == []


@pytest.mark.parametrize("method", ["watch_stress", "watch_tearing"])
def test_what_cannot_be_watched_is_refused_and_the_old_threshold_stays(swinging, method):
    body, _, line = swinging.bodies
    getattr(body, method)(1.0)
    for bad in (0, -1.0, np.nan, np.inf, "1e4", True, [1e4]):
        with pytest.raises(OptionError, match="Pa"):
            getattr(body, method)(bad)
    with pytest.raises(MeshError, match="no tetrahedra"):
        getattr(line, method)(1e4)
    swinging.step(DT, 8)
    assert [event.body for event in swinging.drain_events()] == [body]


def test_nothing_is_watched_before_build_or_of_who_is_gone_and_nothing_recorded_by_the_attempt():
    world = bare_world(floor=None)
    body = world.add_body(BEAM, Material(2e5, 0.3, 1000.0))
    with pytest.raises(StateError, match="build"):
        body.watch_stress(1e4)
    world.build()
    world.despawn(body)
    with pytest.raises(StateError, match="removed"):
        body.watch_stress(1e4)
    with pytest.raises(StateError, match="record_events"):
        world.drain_events()
