"""Options that exclude each other are in one list, which the page prints. Each is refused as it says."""

from pathlib import Path

import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Contact,
    Material,
    Plasticity,
    SoftBodyAsset,
    Stiffness,
    TaichiSoftError,
    box,
    cloth,
    sphere,
)
from taichi_soft.core import conflicts
from taichi_soft.world.bare import bare_world

RUBBER = Material(1e5, 0.3, 1000.0)
WOOD = AnisotropicMaterial(Stiffness.isotropic(1e4, 0.3), 500.0)
CUBE, BALL = box(cells=(1, 1, 1)), sphere(0.5, 2)


def build(asset, **options):
    world = bare_world(**options)
    world.add_body(asset, position=(0, 0, 2))
    world.build()


def caged(**options):
    return SoftBodyAsset.from_surface((BALL.vertices, BALL.surface), RUBBER, cells=3, **options)


def asset(material=RUBBER, **options):
    return SoftBodyAsset(CUBE, material, **options)


REFUSED = {
    conflicts.FLAT: lambda: build(asset(), schedule="flat", soft_contact=True),
    conflicts.FLAT_SOLVES: lambda: bare_world(schedule="flat", integrator="implicit_euler"),
    conflicts.ONLY_FLAT: lambda: build(asset(), schedule="per_body", integrator="explicit_euler"),
    conflicts.SOLVED: lambda: build(caged(hull=60), integrator="implicit_euler"),
    conflicts.HULL_CUTS: lambda: caged(hull=60, spare_vertices=10),
    conflicts.HULL_ITSELF: lambda: caged(hull=60, contact=Contact(itself=True)),
    conflicts.EDGE_LAW_CUTS: lambda: asset(law="cmpm", spare_vertices=10),
    conflicts.EDGE_LAW_FLOW: lambda: asset(law="cmpm", plasticity=Plasticity(yield_stress=1e3)),
    conflicts.EDGE_LAW_CAGE: lambda: caged(law="cmpm"),
    conflicts.ANISOTROPIC_LAW: lambda: asset(WOOD, law="neo_hookean"),
    conflicts.ANISOTROPIC_FAILURE: lambda: asset(WOOD, law="virial", plasticity=Plasticity(yield_stress=1e3)),
    conflicts.NO_TETRAHEDRA: lambda: SoftBodyAsset(cloth((1, 1), (2, 2), 0.1), RUBBER, law="virial"),
}


@pytest.mark.parametrize(
    "conflict", conflicts.CONFLICTS, ids=lambda each: f"{each.option}, {each.features[:20]}"
)
def test_what_does_not_go_together_is_refused_with_the_reason_and_the_solution_of_the_list(conflict):
    with pytest.raises(TaichiSoftError) as refusal:
        REFUSED[conflict]()
    assert str(refusal.value).endswith(f"because {conflict.reason}: {conflict.solution}")
    assert " does not support " in str(refusal.value)


def test_the_page_of_limits_has_the_whole_list():
    page = (Path(__file__).parents[2] / "docs" / "limits.md").read_text()
    rows = [
        f"| {each.option} | {each.features} | {each.reason} | {each.solution} |"
        for each in conflicts.CONFLICTS
    ]
    assert "\n".join(rows) in page
    assert len(rows) <= 12
