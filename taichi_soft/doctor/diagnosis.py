"""Diagnose a mesh file: report findings, figures and advice."""

from __future__ import annotations

import time
import warnings
from dataclasses import asdict, dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.sag import MAX_SAG, sag
from taichi_soft.cages import tetrahedra_of
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.errors import MeshError, TaichiSoftError
from taichi_soft.core.types import CageMethodName
from taichi_soft.doctor.triangle_facts import SurfaceFacts, facts_of
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh, load_mesh
from taichi_soft.meshing.io import SURFACES
from taichi_soft.meshing.surfaces import Up, assumed_up, read_surfaces
from taichi_soft.world.world import World

FRAME = 1 / 60
"""Length of a frame [s]."""

MOST_SUBSTEPS = 500
"""Largest acceptable number of substeps per frame. `World` warns above this number."""

SMALLEST, LARGEST = 0.02, 50.0
"""Smallest and largest usual size of an object in a game [m]. Another size suggests that the file uses
another unit."""

THIN = 0.5
"""Fraction of a tetrahedron's volume. If less of the volume is solid, the tetrahedron counts as thin."""

MOST_THIN = 0.3
"""Largest acceptable fraction of the solid volume that is in thin tetrahedra, see `THIN`. Some tetrahedra are
thin at every surface."""

TRIALS = 30
"""Number of timed frames."""


class Grade(str, Enum):
    """Severity of a finding."""

    GOOD = "good"
    NOTE = "note"
    BAD = "bad"  # cannot be simulated


@dataclass(frozen=True)
class Finding:
    """One result of a diagnosis: its severity, and a sentence."""

    grade: Grade
    text: str


@dataclass
class Diagnosis:
    """Result of `diagnose`: all findings and figures of a mesh."""

    name: str
    findings: list[Finding] = field(default_factory=list)
    surface: SurfaceFacts | None = None
    figures: dict[str, float] = field(default_factory=dict)  # measured values of the body, by name with unit

    @property
    def is_fit(self) -> bool:
        """True if the mesh can be simulated."""
        return all(finding.grade is not Grade.BAD for finding in self.findings)

    def as_plain(self) -> dict[str, Any]:
        """Convert to plain types for JSON."""
        return {
            "file": self.name,
            "would_simulate": self.is_fit,
            "findings": [{"grade": each.grade.value, "text": each.text} for each in self.findings],
            "surface": None if self.surface is None else asdict(self.surface),
            "body": self.figures,
        }

    def say(self, grade: Grade, text: str) -> None:
        """Add a finding."""
        self.findings.append(Finding(grade, text))


def diagnose(
    path: Path,
    material: Material,
    *,
    cells: int | None = None,
    method: CageMethodName = "lattice",
    up: Up | None = None,
) -> Diagnosis:
    """Check a file, make a body from it, and time simulated frames of the body.

    Args:
        path: file of a surface, see `read_surfaces`, or of tetrahedra, see `load_mesh`.
        material: material of the body.
        cells, method, up: see `SoftBodyAsset.from_surface`.
    Raises: MeshError or OptionError for a file that cannot be read.
    """
    found = Diagnosis(path.name)
    if path.suffix.lower() in SURFACES:
        surfaces = read_surfaces(path, up)
        if up is None and (assumed := assumed_up(path)):
            found.say(Grade.GOOD, assumed)
        for note in dict.fromkeys(note for each in surfaces for note in each.notes):
            found.say(Grade.NOTE, note)
        found.surface = facts_of(surfaces)
        _judge_surface(found, found.surface)
        try:
            made = tetrahedra_of(surfaces, cells=cells, method=method)
        except MeshError as error:
            found.say(Grade.BAD, str(error))
            return found
        asset = SoftBodyAsset(made.mesh, material, skin=surfaces)
        for words in made.notes:
            found.say(Grade.NOTE, words)
        if made.is_refined:
            plain = tetrahedra_of(surfaces, cells=cells, refine=0).mesh
            _judge_refinement(found, asset, SoftBodyAsset(plain, material))
    else:
        asset = SoftBodyAsset(load_mesh(path), material)
        _judge_size(found, float(np.ptp(asset.mesh.vertices, axis=0).max()))
    _judge_body(found, asset)
    return found


def _judge_size(found: Diagnosis, size: float) -> None:
    if not SMALLEST <= size <= LARGEST:
        unit, factor = ("millimetres", 0.001) if size > LARGEST else ("kilometres", 1000.0)
        found.say(
            Grade.NOTE,
            f"it is {size:.4g} m long, probably in another unit such as {unit}: then scale it by {factor:g}",
        )


def _judge_surface(found: Diagnosis, facts: SurfaceFacts) -> None:
    meshes = "1 mesh" if facts.meshes == 1 else f"{facts.meshes} meshes"
    found.say(
        Grade.GOOD,
        f"{facts.triangles:,} triangles in {meshes} and {facts.parts} connected "
        f"{'part' if facts.parts == 1 else 'parts'}, {facts.size:.4g} m long",
    )
    _judge_size(found, facts.size)
    if facts.open_edges == facts.crowded_edges == facts.turned_edges == 0:
        found.say(Grade.GOOD, "it is closed, and all triangles are oriented consistently")
    for count, text in (
        (facts.open_edges, "open edges: holes are closed with flat patches when the body is made"),
        (facts.turned_edges, "edges between triangles of opposite orientation: harmless here"),
        (facts.crowded_edges, "edges of more than two triangles: interior walls are ignored"),
        (facts.flat_triangles, "triangles without area: they are ignored"),
        (facts.repeated_triangles, "duplicate triangles: they are ignored"),
    ):
        if count:
            found.say(Grade.NOTE, f"{count:,} {text}")


def _judge_refinement(found: Diagnosis, asset: SoftBodyAsset, plain: SoftBodyAsset) -> None:
    """Report the tetrahedra and substeps that are needed to keep limbs and sheets thinner than the cells."""
    counts = [len(each.mesh.tets) for each in (plain, asset) if isinstance(each.mesh, TetMesh)]
    shorter = plain.stable_step.recommended / asset.stable_step.recommended
    found.say(
        Grade.NOTE,
        f"keeping them takes {counts[1]:,} tetrahedra instead of {counts[0]:,}, and "
        f"{shorter:.1f} times as many substeps",
    )


def _judge_body(found: Diagnosis, asset: SoftBodyAsset) -> None:
    mesh, step = asset.mesh, asset.stable_step
    assert isinstance(mesh, TetMesh)
    substeps = int(np.ceil(FRAME / step.recommended))
    quality = mesh.quality
    found.figures = {
        "tetrahedra": len(mesh.tets),
        "vertices": len(mesh.vertices),
        "mass [kg]": float(asset.description.masses.sum()),
        "least dihedral angle [degrees]": float(quality.min_dihedral.min()),
        "greatest dihedral angle [degrees]": float(quality.max_dihedral.max()),
        "stable substep [s]": step.recommended,
        "substeps of a 60 Hz frame": substeps,
        "first frequency [Hz]": asset.first_frequency / (2 * np.pi),
    }
    thin = float((mesh.volumes * mesh.fill)[mesh.fill < THIN].sum() / (mesh.volumes * mesh.fill).sum())
    if thin > MOST_THIN:
        found.say(
            Grade.NOTE,
            f"{100 * thin:.0f} % of it is thinner than a cell and too stiff: use twice as many cells if "
            "that matters",
        )
    squash = sag(asset, GRAVITY_EARTH)
    found.figures["sag under its own weight [%]"] = 50.0 * squash
    if squash > MAX_SAG:
        young = squash / MAX_SAG * float(np.mean(np.asarray(asset.description.per_tet("young") / mesh.fill)))
        found.say(
            Grade.BAD,
            f"it collapses under its own weight: use a Young's modulus of {young:.2g} Pa or a smaller body",
        )
    if substeps > MOST_SUBSTEPS:
        found.say(Grade.BAD, f"{substeps:,} substeps per frame are too many for a game: {step.reason}")
        return
    try:
        found.figures["milliseconds of a 60 Hz frame here"] = 1e3 * _frame_time(asset, substeps)
    except TaichiSoftError as error:
        found.say(Grade.BAD, str(error))
        return
    if found.is_fit:
        found.say(Grade.GOOD, "it can be simulated")


def _frame_time(asset: SoftBodyAsset, substeps: int) -> float:
    """Return the median time of a frame while the body falls and lands [s]."""
    world = World(sleep_speed=0.0)
    low = float(asset.mesh.vertices[:, 2].min())
    world.add_body(asset, position=(0.0, 0.0, 0.01 - low))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        world.build()
        world.step(FRAME, substeps)
        times = []
        for _ in range(TRIALS):
            start = time.perf_counter()
            world.step(FRAME, substeps)
            times.append(time.perf_counter() - start)
    return float(np.median(times))
