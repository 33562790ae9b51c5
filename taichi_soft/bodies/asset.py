"""What all bodies of one kind share: made once, placed many times."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.calibration import calibrated
from taichi_soft.bodies.contact import DEFAULT_CONTACT, THIN, Contact
from taichi_soft.bodies.description import BodyDescription, outer_vertices, require_size
from taichi_soft.bodies.first_mode import first_frequency, guessed_frequency
from taichi_soft.bodies.hull import BoundHull, bind
from taichi_soft.bodies.layout import BodyArrays, HullArrays, arrange, room_of
from taichi_soft.bodies.plasticity import Plasticity
from taichi_soft.bodies.short_steps import warn_of_short_steps
from taichi_soft.bodies.skin import Skin, bound
from taichi_soft.bodies.stability import StableStep, stable_step
from taichi_soft.bodies.tearing import Tearing
from taichi_soft.cages import tetrahedra_of
from taichi_soft.cages.hull import as_hull
from taichi_soft.core.checks import as_count, as_indices, as_rotation, as_vector
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.errors import MaterialError, MeshError, OptionError
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.residue import weighted_sum
from taichi_soft.core.serialisation import digest_of
from taichi_soft.core.types import (
    CageMethodName,
    DampingModel,
    DampingModelName,
    FlipsName,
    LawName,
    StrainName,
)
from taichi_soft.elements.laws import ElementModel, default_law, element_model, fit_model
from taichi_soft.elements.materials import AnisotropicMaterial, AnyMaterial, Material, SpringMaterial
from taichi_soft.meshing import BodyMesh, ParticleMesh, TetMesh
from taichi_soft.meshing.arrays import read_only
from taichi_soft.meshing.cage_mesh import CageMesh
from taichi_soft.meshing.surface import Surface
from taichi_soft.meshing.surfaces import Up, assumed_up, read_surfaces

_log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DAMPING_INTERVAL = 0.5
"""Between two times that vibrations are damped, over the time in which the first mode turns by a radian: 12
times in its period."""

APART = 0.25
"""Of a body's size, by which the sides of a level of detail may lie away from those of the finest."""


@dataclass(frozen=True, eq=False)
class SoftBodyAsset:
    """A kind of body, immutable: what the bodies share that worlds make of it.

    Args:
        mesh: rest shape. A `ParticleMesh` (rope, cloth) takes law "springs".
        material: constants in SI units; a `SpringMaterial` for a `ParticleMesh`.
        law: one of `LAWS`: "virial" (thesis 6.3), "face" (6.2), "st_venant_kirchhoff", "neo_hookean"; and
            along edges "springs" (3.4), "volume_springs" (chapter 5), "cmpm", "cmpm2",
            "best_fitting_plane", "tilted_plane" and "tilted_plane_printed" (chapter 4). None takes
            "neo_hookean"; "virial" where strain or another way with flips is chosen, or for an
            `AnisotropicMaterial`; "springs" for a `SpringMaterial`.
        strain: "linear" (eq. 6.7) or "exact" (square root of U^2); None takes the law's own.
        flips: "tolerant" (the thesis: a mirrored tetrahedron is at rest too), "recover" or "off"; None
            takes the law's own. A law with an energy does what follows from it, and takes no other.
        damping_model: "edge" (eq. 3.9) or "tet_mean" (which section 6.4 rejects: it stops rotation).
        pinned: vertices that stay where they are.
        contact: how its surface touches others, in a world with colliders or soft contact.
        spare_vertices: how many copies of vertices there is room for where `Body.cut` splits them; 0 for a
            body that is not cut. Takes laws that look at tetrahedra. A cut through a body of n vertices needs
            about n^(2/3).
        plasticity: how it is bent for good; None for never. Takes laws that look at tetrahedra, and a
            `Material`.
        tearing: where it tears by itself, into its spare vertices; None for nowhere. Takes a `Material`.
        skin: what is drawn in place of its surface, as `read_surfaces` takes it: a file, a trimesh.Trimesh or
            Scene. See `Body.render_meshes`.
        hull: by what it touches others in place of the surface of its tetrahedra: by points of its skin and
            triangles between them, so many (12 to 20,000) or, if True, enough; or by the vertices and
            triangles of a surface of your own, as `read_surfaces` takes it. None for the surface. See
            docs/artists-mesh.md. Takes tetrahedra, no spare vertices, and no contact of the body with itself.
        coarser: the same thing of fewer and fewer tetrahedra, as `with_coarser` makes it: levels of detail
            for `Body.set_level`. Takes no spare vertices and no plasticity.
    Raises: MeshError, MaterialError or OptionError for bad input.
    Example:
        crate = SoftBodyAsset(box((0.4, 0.4, 0.4), (3, 3, 3)), jelly, contact=Contact(friction=0.8))
        arena = World()
        arena.reserve(crate, 10)  # room for ten of them
    """

    mesh: BodyMesh
    material: AnyMaterial
    _: KW_ONLY
    law: LawName | None = None
    strain: StrainName | None = None
    flips: FlipsName | None = None
    damping_model: DampingModelName = DampingModel.EDGE
    pinned: ArrayLike = ()
    contact: Contact = DEFAULT_CONTACT
    plasticity: Plasticity | None = None
    spare_vertices: int = 0
    tearing: Tearing | None = None
    skin: Any = ()
    hull: Any = None
    coarser: tuple[SoftBodyAsset, ...] = ()
    description: BodyDescription = field(init=False)

    def __post_init__(self) -> None:
        if self.law is None:
            object.__setattr__(self, "law", default_law(self.material, self.strain, self.flips))
        assert self.law is not None
        model = element_model(self.law, self.strain, self.flips, self.damping_model)
        model = fit_model(model, self.mesh, self.material)
        if not isinstance(self.contact, Contact):
            raise OptionError(f"contact must be a Contact, got {self.contact!r}")
        as_count(self.spare_vertices, "spare_vertices", 0)
        if self.spare_vertices and model.has_bonds:
            raise OptionError(f"law {self.law!r} cannot be cut: it looks at edges, 'virial' at tetrahedra")
        if self.tearing is not None:
            self._require_tears(model)
        if self.plasticity is not None:
            self._require_flow(model)
        surfaces = () if isinstance(self.skin, tuple) and not self.skin else read_surfaces(self.skin)
        if surfaces and not isinstance(self.mesh, TetMesh):
            raise MeshError(f"a skin needs tetrahedra to hang on, and {self.mesh!r} has none")
        if model.has_bonds and isinstance(self.mesh, CageMesh):
            raise OptionError(f"law {self.law!r} takes no cage: it looks at edges, 'virial' at tetrahedra")
        pinned = read_only(as_indices(self.pinned, "pinned", len(self.mesh.vertices)))
        require_size(self.mesh)
        description = BodyDescription(self.mesh, self.material, model, pinned)
        _ = description.bonds  # made now, because a pairwise law may refuse the mesh
        object.__setattr__(self, "pinned", pinned)
        object.__setattr__(self, "description", description)
        object.__setattr__(self, "skin", surfaces)
        outer = len(self.mesh.surface_vertices) if isinstance(self.mesh, TetMesh) else 0
        object.__setattr__(self, "hull", as_hull(self.hull, surfaces, outer))
        if self.hull is not None:
            self._require_hull()
        object.__setattr__(self, "coarser", self._checked_levels(self.coarser))

    def _checked_levels(self, coarser: object) -> tuple[SoftBodyAsset, ...]:
        """Raises: OptionError, MeshError for what are no levels of detail of this asset."""
        if not isinstance(coarser, (tuple, list)) or not all(
            isinstance(each, SoftBodyAsset) for each in coarser
        ):
            raise OptionError(f"coarser must be a tuple of assets, got {coarser!r}")
        if coarser and (self.spare_vertices or self.plasticity is not None):
            raise OptionError("an asset that is cut, tears or is bent for good has no levels of detail")
        for level, each in enumerate(coarser, start=1):
            if each.coarser or each.spare_vertices or each.plasticity is not None:
                raise OptionError(f"level {level} must be without levels, cuts and plasticity of its own")
            if each.description.model != self.description.model or each.contact != self.contact:
                raise OptionError(f"level {level} must have the law and the contact of the finest")
            if each.hull is not self.hull and digest_of(each.hull) != digest_of(self.hull):
                raise OptionError(f"level {level} must have the hull of the finest")
            if not _are_same(each.skin, self.skin):
                raise OptionError(
                    f"level {level} must have the skin of the finest: with_coarser gives it that"
                )
            if self.description.bonds is not None:
                raise OptionError(f"law {self.law!r} has no levels of detail: it looks at edges")
            self._require_coarser((self, *coarser)[level - 1], each, level)
        return tuple(coarser)

    def _require_coarser(self, before: SoftBodyAsset, asset: SoftBodyAsset, level: int) -> None:
        """Raises: MeshError for a level that is not coarser than the one before, or of something else."""
        room, needed = room_of(self.arrays, 0), room_of(asset.arrays, 0)
        if len(asset.mesh.tets) >= len(before.mesh.tets) or any(
            n > m for n, m in zip(needed, room, strict=True)
        ):
            raise MeshError(
                f"level {level}: {len(asset.mesh.tets)} tetrahedra and {needed[0]} vertices are not fewer "
                f"than the {len(before.mesh.tets)} and {len(before.mesh.vertices)} of the level before: take "
                "fewer cells, or leave smaller cells round thin limbs out (from_surface, refine=0)"
            )
        (low, high), (own_low, own_high) = (
            (each.mesh.vertices.min(axis=0), each.mesh.vertices.max(axis=0)) for each in (self, asset)
        )
        size = float((high - low).max())
        if max(np.abs(own_low - low).max(), np.abs(own_high - high).max()) > APART * size:
            raise MeshError(
                f"level {level} lies from {own_low.round(4).tolist()} to {own_high.round(4).tolist()} m, the "
                f"finest from {low.round(4).tolist()} to {high.round(4).tolist()}: it must be the same thing"
            )

    @property
    def levels(self) -> tuple[SoftBodyAsset, ...]:
        """All levels of detail, the finest first, which is this one."""
        return (self, *self.coarser)

    def with_coarser(self, *meshes: TetMesh) -> SoftBodyAsset:
        """The same with levels of detail of these meshes, each coarser than the one before.

        Their constants are such that they weigh as much and vibrate as fast in the slowest modes. Takes
        seconds for each.
        Args:
            meshes: rest shapes of fewer and fewer tetrahedra.
        Raises: MeshError for a mesh that is not coarser; MaterialError for another material than one with a
            number for each constant; OptionError for a body that is cut, tears, is bent for good, or whose
            law looks at edges. All of them before that work begins.
        """
        material = self.material
        if not isinstance(material, Material) or any(
            np.ndim(getattr(material, name)) for name in ("young", "poisson", "density")
        ):
            raise MaterialError("levels of detail take a Material with one number for each constant")
        plain = {
            name: getattr(self, name)
            for name in ("law", "strain", "flips", "damping_model", "contact", "skin", "hull")
        }
        levels = []
        for mesh in meshes:
            if not isinstance(mesh, TetMesh):
                raise MeshError(f"a level of detail must be a TetMesh, got {mesh!r}")
            held = mesh.vertices[:, None] - self.mesh.vertices[self.description.pinned]
            pinned = np.unique((held**2).sum(axis=2).argmin(axis=0)) if held.shape[1] else ()
            levels.append(SoftBodyAsset(mesh, material, pinned=pinned, **plain))
        self._checked_levels(levels)
        # Takes seconds: only now that nothing is refused.
        materials = calibrated(self.description, [each.description for each in levels])
        fitted = (replace(each, material=its) for each, its in zip(levels, materials, strict=True))
        return replace(self, coarser=tuple(fitted))

    def _require_hull(self) -> None:
        if not isinstance(self.mesh, TetMesh):
            raise MeshError(f"a hull needs tetrahedra to hang on, and {self.mesh!r} has none")
        if self.spare_vertices:
            raise OptionError("an asset that is cut or tears takes no hull: it cannot follow a cut")
        if self.contact.itself:
            raise OptionError("contact of a body with itself takes no hull: leave out the one or the other")

    def _require_tears(self, model: ElementModel) -> None:
        if not isinstance(self.tearing, Tearing):
            raise OptionError(f"tearing must be a Tearing or None, got {self.tearing!r}")
        if self.spare_vertices == 0:
            raise OptionError("tearing takes spare_vertices: a tear makes copies of vertices")
        if model.is_anisotropic:
            raise MaterialError("an AnisotropicMaterial takes no tearing: its strength has directions too")

    def _require_flow(self, model: ElementModel) -> None:
        if not isinstance(self.plasticity, Plasticity):
            raise OptionError(f"plasticity must be a Plasticity or None, got {self.plasticity!r}")
        if model.has_bonds:
            raise OptionError(
                f"law {self.law!r} takes no plasticity: it looks at edges, 'virial' at tetrahedra"
            )
        if model.is_anisotropic:
            raise MaterialError("an AnisotropicMaterial takes no plasticity: it does not yield by von Mises")

    def __repr__(self) -> str:
        return f"SoftBodyAsset({self.mesh!r}, {self.law!r})"

    @classmethod
    def from_surface(
        cls,
        surface: Any,
        material: AnyMaterial,
        *,
        cells: int | Sequence[int] | None = None,
        cell_size: float | None = None,
        method: CageMethodName = "lattice",
        time_limit: float | None = None,
        refine: int | None = None,
        up: Up | None = None,
        center: bool = False,
        scale: float = 1.0,
        **options: Any,
    ) -> SoftBodyAsset:
        """A body from an artist's mesh: a cage of tetrahedra that carries the mesh as its skin.

        The surface may have holes, faces turned round, walls within and parts that overlap: see
        `taichi_soft.cages`. Mass, centre and inertia are those of the solid that it encloses.
        Args:
            surface: path of a .glb, .gltf, .obj, .ply, .stl or .off file, a trimesh.Trimesh or Scene, or
                (vertices (n, 3) [m], triangles (m, 3)).
            material: of the solid.
            cells: of the cage along the longest side; 10 if neither this nor cell_size is given. Several
                numbers, the largest first, make levels of detail: see `with_coarser`.
            cell_size: edge of a cell [m], instead of `cells`.
            method: of making the tetrahedra. "lattice" takes every surface, needs no other package and gives
                the longest substeps. Two others fill the surface, in a process of their own: "ftetwild"
                (extra `ftetwild`: fTetWild, MPL-2.0) follows it within a twentieth of a cell, and is not the
                same on every run. "tetgen" (extra `tetgen`) keeps every triangle of a closed one. TetGen's
                licence is the AGPL: it asks for the source of all that is shipped or served with it.
            time_limit: of such a process, after which it is ended [s]; None takes 120.
            refine: of "lattice": how often cells are halved, at most, round limbs and sheets that would be
                left out, thinner than about a sixteenth of a cell: 0 to 3, and 1 if None. Each time halves
                the substep. What stays left out is drawn, but neither bends nor touches anything. Both is
                logged, with the `cell_size` that keeps it.
            up: axis that points up in the file, "y" or "z"; None takes "y" for .glb, .gltf and .obj, and "z"
                for all else, which is what most programs write.
            center: move the middle of the box round it to the origin, as a file needs that lies kilometres
                away from it (geographic coordinates): positions are 32-bit numbers.
            scale: factor from the unit of the file to metres: 0.001 for millimetres.
            options: further arguments of `SoftBodyAsset`. A `skin` is drawn in place of the surface.
        What was assumed, repaired or left out of the file is logged (logger `taichi_soft`).
        Raises: MeshError for a surface that cannot be read or encloses nothing, with the way out, and for a
            process that crashes or takes too long; OptionError for cells out of range, with the memory that
            they would take; MissingExtraError without the package of the method.
        Example:
            duck = SoftBodyAsset.from_surface("duck.glb", jelly, cells=8)
            print(duck.mesh.quality.summary())
        """
        surfaces = read_surfaces(surface, up, center=center, scale=scale)
        if up is None and (assumed := assumed_up(surface)):
            _log.info("%s", assumed)
        for note in dict.fromkeys(note for each in surfaces for note in each.notes):
            _log.warning("%s", note)
        numbers: list[Any] = [cells]
        if isinstance(cells, (tuple, list, np.ndarray)):
            numbers = [as_count(number, "cells", 1, 1_000_000) for number in cells]
        if not numbers:
            raise OptionError("cells is empty: give a number, or some numbers for levels of detail")
        meshes: list[TetMesh] = []
        for number in numbers:
            made = tetrahedra_of(
                surfaces,
                cells=number,
                cell_size=cell_size,
                method=method,
                time_limit=time_limit,
                refine=refine,
            )
            if method != "lattice":
                warn_of_short_steps(made.mesh, made.cell_size, method)
            for words in made.notes:
                _log.warning("%s", words)
            meshes.append(made.mesh)
        asset = cls(meshes[0], material, **{"skin": surfaces, **options})
        return asset.with_coarser(*meshes[1:]) if meshes[1:] else asset

    @cached_property
    def skins(self) -> tuple[Skin, ...]:
        """Surfaces that are drawn in place of its own, bound to its tetrahedra."""
        if not self.skin:
            return ()
        assert isinstance(self.mesh, TetMesh)
        return bound(self.mesh, self.skin)

    @cached_property
    def bound_hull(self) -> BoundHull | None:
        """Its hull, bound to its tetrahedra."""
        if self.hull is None:
            return None
        assert isinstance(self.mesh, TetMesh)
        return bind(self.mesh, self.hull)

    @cached_property
    def arrays(self) -> BodyArrays:
        """The body in the order in which the kernels walk it: slow to make, and made once."""
        arrays, hull = arrange(self.description), self.bound_hull
        if hull is None:
            return arrays
        carriers = arrays.rank[hull.vertices]
        return replace(arrays, hull=HullArrays(carriers, hull.weights, hull.triangles))

    def touching_points(self, x: Floats) -> Floats:
        """Where the points are by which it touches colliders, of vertices at `x` (n, 3) [m].

        Args:
            x: positions of the vertices, (n, 3) [m].
        """
        hull = self.bound_hull
        if hull is None:
            return x[outer_vertices(self.mesh)]
        return np.asarray((hull.weights[:, :, None] * x[hull.vertices]).sum(axis=1))  # corner by corner

    @cached_property
    def stable_step(self) -> StableStep:
        """Estimate of the largest stable substep."""
        return stable_step(self.mesh, self.material, self.description.model)

    @cached_property
    def first_frequency(self) -> float:
        """Angular frequency of the slowest vibration where nothing holds the body [rad/s], from above by less
        than a fifth; 0 for ropes and cloth, which bend freely."""
        return 0.0 if isinstance(self.mesh, ParticleMesh) else first_frequency(self.description)

    @cached_property
    def guessed_frequency(self) -> float:
        """About the same, sooner found; 0 also for pairwise laws."""
        return guessed_frequency(self.description)

    def vibration_row(self, body: BodyDescription) -> tuple[float, float]:
        """How vibrations of a body of this asset fade, which may be cut or of another material: at what rate
        [1/s], and after what time at most they are damped again [s].

        Of another material the frequency goes with the root of its mean stiffness over its mass.
        Args:
            body: description of that body.
        """
        material = body.material
        if isinstance(material, SpringMaterial) or material.damping_ratio * self.first_frequency == 0.0:
            return 0.0, 1.0
        frequency = self.first_frequency
        if material is not self.material:
            frequency *= float(np.sqrt(_mean_stiffness(body) / _mean_stiffness(self.description)))
        return 2.0 * material.damping_ratio * frequency, DAMPING_INTERVAL / max(frequency, 1e-6)

    def kind_row(self, *, is_implicit: bool) -> tuple[float, ...]:
        """What `BodyFields.load` takes of a body of this asset: `body_edge`, `body_stride`,
        `body_sound_speed` and `vibration_row`.

        Args:
            is_implicit: its world steps by implicit Euler, whose substeps have any length: no stride.
        """
        speed = self.description.sound_speed
        stride = 0.0 if is_implicit else self.stable_step.recommended * speed
        return self.surface_row[2], stride, speed, *self.vibration_row(self.description)

    @cached_property
    def surface_row(self) -> tuple[float, float, float]:
        """Friction, thickness [m] and mean edge [m] of what touches: the hull, or the surface, or all edges
        where there are no triangles."""
        corners = self.mesh.surface if len(self.mesh.surface) else self.mesh.edges
        ends = self.mesh.vertices[np.concatenate([corners[:, :2], corners[:, -2:]])]
        edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
        if self.bound_hull is not None:
            edge = self.bound_hull.mean_edge
        thickness = self.contact.thickness
        return self.contact.friction, THIN * edge if thickness is None else thickness, edge

    @cached_property
    def center_of_mass(self) -> Floats:
        """Of its mesh, (3,) [m]."""
        masses = self.description.masses
        return np.asarray(weighted_sum(masses, self.mesh.vertices) / masses.sum())

    @cached_property
    def rest_rows(self) -> Floats32:
        """Position, velocity, inverse mass and mass of each vertex, (n, 8), of a body where its mesh is."""
        rows = np.zeros((len(self.mesh.vertices), 8), dtype=np.float32)
        rows[:, :3] = self.mesh.vertices
        rows[:, 6] = 1.0 / self.description.masses
        rows[:, 7] = self.description.masses
        rows[self.description.pinned, 6] = 0.0
        return rows

    def placed(
        self,
        position: ArrayLike,
        rotation: ArrayLike | None,
        velocity: ArrayLike,
        angular_velocity: ArrayLike,
        floor: float | None,
    ) -> Floats32:
        """Position, velocity, inverse mass and mass of each vertex of a body that begins there, (n, 8).

        Args:
            position, rotation, velocity, angular_velocity: as `World.spawn` takes them.
            floor: height of the floor [m], or None.
        Raises: OptionError for bad values, a vertex that is too fast, and a place out of reach or below the
            floor, which would crush the body.
        """
        origin, turn = as_vector(position, "position", "m"), as_rotation(rotation)
        drift = as_vector(velocity, "velocity", "m/s", VELOCITY_LIMIT)
        spin = as_vector(angular_velocity, "angular_velocity", "rad/s")
        x = turned(self.mesh.vertices, turn) + origin
        self._require_place(x, origin, floor)
        rows: Floats32 = self.rest_rows.copy()
        rows[:, :3] = x
        rows[:, 3:6] = drift
        if spin.any():
            a, b, c = spin
            turning = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])  # spin x r = turning @ r
            center = turned(self.center_of_mass[None], turn) + origin
            rows[:, 3:6] += turned(x - center, turning)
            fastest = float(np.abs(rows[:, 3:6]).max())
            if not fastest < VELOCITY_LIMIT:
                raise OptionError(
                    f"angular_velocity {spin.tolist()} rad/s makes a vertex as fast as {fastest:.4g} m/s: "
                    f"stay below {VELOCITY_LIMIT:g}"
                )
        rows[self.description.pinned, 3:6] = 0.0
        return rows

    def _require_place(self, x: Floats, origin: Floats, floor: float | None) -> None:
        if not np.abs(x).max() < POSITION_LIMIT:
            raise OptionError(f"position puts the body beyond {POSITION_LIMIT:g} m: stay nearer the origin")
        lowest, highest = float(self.touching_points(x)[:, 2].min()), float(x[:, 2].max())
        if floor is not None and lowest < floor - 1e-3 * (highest - lowest):
            depth = floor - lowest
            raise OptionError(
                f"the body starts {depth:.4g} m below the floor: position=({origin[0]:g}, {origin[1]:g}, "
                f"{origin[2] + depth:.6g}) puts it on the floor, World(floor=None) has none"
            )


def _are_same(skin: tuple[Surface, ...], other: tuple[Surface, ...]) -> bool:
    """True if two skins have the same vertices and triangles."""
    return len(skin) == len(other) and all(
        a is b or (np.array_equal(a.vertices, b.vertices) and np.array_equal(a.triangles, b.triangles))
        for a, b in zip(skin, other, strict=True)
    )


def _mean_stiffness(body: BodyDescription) -> float:
    """Mean stiffness of a body over its mean density, but for a factor [m^2/s^2]."""
    mesh, material = body.mesh, body.material
    assert isinstance(mesh, TetMesh)
    assert isinstance(material, Material | AnisotropicMaterial)
    if isinstance(material, Material):
        stiffness = body.per_tet("young")
    else:
        stiffness = np.trace(body.stiffness_matrices(), axis1=1, axis2=2)
    return float((mesh.volumes * stiffness).sum() / (mesh.volumes * body.per_tet("density")).sum())
