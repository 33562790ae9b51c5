"""Surfaces with which other meshers fail: they become bodies, or are refused with a suggestion."""

import numpy as np
import pytest
from difficult_surfaces import BODIES, REFUSED, SCALED

from taichi_soft import Material, MeshError, SoftBodyAsset
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

SOFT = Material(young=2e5, poisson=0.3, density=1000.0, damping_ratio=0.2)
CELLS = 8
APART = 3.0  # m


class Fall:
    """Bodies that were dropped onto the floor side by side, after some time at rest."""

    def __init__(self, assets, scale=1.0, seconds=6.0):
        world = self.world = bare_world()
        self.scale, self.dt = scale, np.sqrt(scale) / 60
        self.bodies = {}
        for i, (name, asset) in enumerate(assets.items()):
            above = 0.1 * scale - asset.mesh.vertices[:, 2].min()
            self.bodies[name] = world.add_body(asset, position=(APART * scale * i, 0.0, above))
        world.build()
        for step in range(round(seconds * 60)):
            if step == 120:
                for body in self.bodies.values():
                    body.set_linear_damping(4.0 / np.sqrt(scale))  # or a ball rolls for minutes
            world.step(self.dt)
        self.before = {name: body.positions() for name, body in self.bodies.items()}
        world.step(self.dt)

    def require_rest(self, name):
        """Assert that a body is valid, lies on the floor, has its shape and is slow."""
        body, now = self.bodies[name], self.bodies[name].positions()
        size = np.ptp(body.asset.mesh.vertices, axis=0).max()
        speed = np.sqrt((((now - self.before[name]) / self.dt) ** 2).sum(axis=1).mean())
        assert not body.is_frozen
        assert np.isfinite(now).all()
        assert body.flipped_count() == 0
        assert now[:, 2].min() == pytest.approx(0.0, abs=0.01 * size)
        assert np.ptp(now, axis=0).max() < 1.3 * size
        assert speed < 0.05 * np.sqrt(self.scale)


@pytest.fixture(scope="module")
def assets():
    return {name: SoftBodyAsset.from_surface(mesh, SOFT, cells=CELLS) for name, mesh in BODIES.items()}


@pytest.fixture(scope="module")
def fall(assets):
    return Fall(assets)


@pytest.mark.guard
@pytest.mark.parametrize("name", BODIES)
def test_a_difficult_surface_gets_well_shaped_tetrahedra(assets, name):
    quality = assets[name].mesh.quality
    assert quality.min_dihedral.min() >= 10.0
    assert quality.max_dihedral.max() <= 160.0
    assert (assets[name].mesh.vertex_volumes > 0).all()


@pytest.mark.parametrize("name", BODIES)
def test_a_body_of_a_difficult_surface_falls_and_rests(fall, name):
    fall.require_rest(name)


@pytest.mark.parametrize("scale", SCALED)
def test_a_body_of_another_scale_falls_and_rests(scale):
    """The stiffness is proportional to the size, like the weight per area."""
    soft = Material(young=2e5 * scale, poisson=0.3, density=1000.0, damping_ratio=0.2)
    asset = SoftBodyAsset.from_surface(SCALED[scale], soft, cells=CELLS)
    Fall({"ball": asset}, scale).require_rest("ball")


@pytest.mark.parametrize("name", REFUSED)
def test_a_surface_without_an_inside_is_refused_with_the_cure(name):
    with pytest.raises(MeshError, match="thickness"):
        SoftBodyAsset.from_surface(REFUSED[name], SOFT, cells=CELLS)
