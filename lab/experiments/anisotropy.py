"""Stiffness of bodies in different directions under every law (thesis sections 4.3 and 4.4.1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.directional_stiffness import directions, spread, stretch_modulus
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    Numbers,
    Plot,
    Point,
    Results,
    Section,
    Table,
    Verdict,
)
from taichi_soft import LAWS, Material, TetMesh, box, cylinder, delaunay_mesh, load_mesh, sphere
from taichi_soft.core.package_data import ASSETS

MATERIAL = Material(1e6, 0.25, 1000.0, damping_ratio=0.0)
RIGHT = float(MATERIAL.lame_lambda + 2 * MATERIAL.lame_mu)
"""Theoretical stiffness of this isotropic material, equal in all directions [Pa]."""

COMPARED = ("cmpm", "cmpm2")
LEFT_OUT = ("face", "tilted_plane_printed", "neo_hookean")
"""Laws that a quick report omits, because each takes seconds to compile."""

LEAST_SPREAD = 1e-3
"""Smallest spread of the stiffness at which a mesh counts as evidence about a law. A mesh with a smaller
spread hides the anisotropy of the law."""


def jittered_block(cells: int, seed: int = 0) -> TetMesh:
    """Make a Delaunay mesh of a cube of 1 m whose inner vertices are moved at random."""
    grid = box((1.0, 1.0, 1.0), (cells,) * 3)
    inner = (np.abs(grid.vertices - grid.bounds.mean(axis=0)) < 0.499).all(axis=1)
    move = np.random.default_rng(seed).uniform(-0.25, 0.25, grid.vertices.shape) / cells
    return delaunay_mesh(TetMesh(grid.vertices + inner[:, None] * move, grid.tets))


def mesh_of(name: str, size: int) -> TetMesh:
    """Make a mesh by name.

    Args:
        size: number of elements along the mesh; ignored for the beam with a hole.
    """
    shapes = {
        "block": lambda: box((1.0, 1.0, 1.0), (size,) * 3),
        "cylinder": lambda: cylinder(1.0, 2.0, rings=size - 1, layers=size),
        "ball": lambda: sphere(1.0, size - 1),
        "uneven block": lambda: jittered_block(size),
        "another uneven block": lambda: jittered_block(size, seed=1),
        "beam with hole": lambda: load_mesh(ASSETS / "beam_with_hole.npz"),
    }
    return shapes[name]()


MESHES = ("uneven block", "block", "cylinder", "ball")


def points(effort: Effort) -> list[Point]:
    """List the points: CMPM and CMPM2 on all meshes, all other laws on the block."""
    size, count = (3, 24) if effort is Effort.QUICK else (6, 200)
    others = [law for law in LAWS if law not in (*COMPARED, *(LEFT_OUT if effort is Effort.QUICK else ()))]
    pairs = [(law, mesh) for law in COMPARED for mesh in MESHES] + [(law, "block") for law in others]
    return [{"law": law, "mesh": mesh, "size": size, "directions": count} for law, mesh in pairs]


def in_plane(count: int) -> NDArray[np.float64]:
    """Return unit vectors in the x-z plane, evenly spread over half a turn, (count + 1, 3)."""
    turn = np.pi * np.arange(count + 1) / count
    return np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)


def measure(point: Point) -> Numbers:
    """Measure the stiffness in many directions, divided by lambda + 2 mu.

    The directions are those of a hemisphere ("around") and of the x-z plane ("plane").
    """
    mesh, law = mesh_of(point["mesh"], point["size"]), point["law"]

    def stiffness(rows: NDArray[np.float64]) -> list[float]:
        return [round(stretch_modulus(mesh, MATERIAL, law, n) / RIGHT, 9) for n in rows]

    return {"around": stiffness(directions(point["directions"])), "plane": stiffness(in_plane(24))}


def conclude(results: Results) -> Section:
    """Judge the spreads of CMPM and CMPM2, and compare all laws on one mesh."""
    spreads = {
        (law, mesh): spread(results.one(law=law, mesh=mesh)["around"]) for law in COMPARED for mesh in MESHES
    }
    ratios = {
        mesh: spreads["cmpm2", mesh] / spreads["cmpm", mesh]
        for mesh in MESHES
        if max(spreads[law, mesh] for law in COMPARED) > LEAST_SPREAD
    }
    agrees = bool(ratios) and all(spreads["cmpm2", mesh] > LEAST_SPREAD for mesh in ratios)
    stated = "; ".join(
        f"{mesh} {100 * spreads['cmpm', mesh]:.2g} % and {100 * spreads['cmpm2', mesh]:.2g} %"
        for mesh in MESHES
    )
    finding = Finding(
        "cmpm2-anisotropic",
        f"stiffness over all directions varies, CMPM and CMPM2: {stated}. In one regular tetrahedron "
        "(fig-4.5) both vary by the same",
        Verdict.AGREES if agrees else Verdict.DIFFERS if ratios else Verdict.UNKNOWN,
        ""
        if agrees
        else "the mesh decides: CMPM2's spread over CMPM's is "
        + ", ".join(f"{ratio:.2g} in the {mesh}" for mesh, ratio in ratios.items())
        if ratios
        else "all of these meshes are too even to show any",
    )
    block = {point["law"]: numbers for point, numbers in results.where(mesh="block")}

    def draw(figure: Any) -> None:
        axes = figure.add_subplot(projection="polar")
        turn = np.pi * np.arange(25) / 24
        for law, numbers in block.items():
            values = np.array(numbers["plane"])
            axes.plot(np.r_[turn, turn[1:] + np.pi], np.r_[values, values[1:]], label=law)
        axes.plot(2 * turn, np.ones_like(turn), "k:", label="right")
        axes.set_rmin(0)
        axes.set_rlabel_position(67.5)
        axes.set_xlabel("stiffness, over lambda + 2 mu [1]; angle to the x axis")
        axes.legend(loc="center left", bbox_to_anchor=(1.1, 0.5), fontsize="small")

    def draw_meshes(figure: Any) -> None:
        axes = figure.add_subplot()
        place = np.arange(len(MESHES))
        for i, law in enumerate(COMPARED):
            axes.bar(place + (i - 0.5) * 0.4, [100 * spreads[law, mesh] for mesh in MESHES], 0.4, label=law)
        axes.set_xticks(place, MESHES)
        axes.set_ylabel("spread of stiffness [%]")
        axes.legend()

    return Section(
        (
            "Bodies are stretched uniformly along many directions. The work gives their stiffness, which "
            "for an isotropic material is lambda + 2 mu in every direction. Laws along edges are softer in "
            "some directions than in others. Except for volume springs they are softer than the material "
            "in all directions, because strain across an edge does not change its tension. Volume springs "
            "are too stiff. Laws on tetrahedra are isotropic.",
        ),
        (finding,),
        (
            Table(
                "laws",
                f"Block, nu = {MATERIAL.poisson}: stiffness over lambda + 2 mu",
                ("law", "least [1]", "mean [1]", "largest [1]", "spread [1]"),
                tuple(
                    (
                        law,
                        *(f"{f(numbers['around']):.3f}" for f in (np.min, np.mean, np.max)),
                        f"{spread(numbers['around']):.2g}",
                    )
                    for law, numbers in block.items()
                ),
            ),
            Table(
                "meshes",
                "Largest less smallest stiffness over all directions, over the mean",
                ("mesh", *(f"{law} [1]" for law in COMPARED)),
                tuple((mesh, *(f"{spreads[law, mesh]:.2g}" for law in COMPARED)) for mesh in MESHES),
            ),
        ),
        (
            Plot(
                "polar",
                "Stiffness of a block against stretches in the x-z plane: right is the dotted circle of 1.",
                draw,
                (7.5, 4.6),
            ),
            Plot("meshes", "Spread of the stiffness of CMPM and CMPM2 on four meshes.", draw_meshes),
        ),
    )


ANISOTROPY = Experiment(
    "anisotropy",
    "Anisotropy that nobody asked for",
    "sections 4.3 and 4.4.1",
    ("cmpm2-anisotropic",),
    points,
    measure,
    conclude,
)
