"""Soft-body assets: the data that all bodies of one kind share."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.bound_hull import BoundHull, bind
from taichi_soft.bodies.calibration import calibrated
from taichi_soft.bodies.contact import DEFAULT_CONTACT, DEFAULT_THICKNESS, RIGID_THICKNESS, Contact
from taichi_soft.bodies.contact_edges import find_contact_edges, has_slim_edges
from taichi_soft.bodies.description import BodyDescription, outer_vertices, require_size
from taichi_soft.bodies.first_mode import first_frequency, guessed_frequency
from taichi_soft.bodies.layout import BodyArrays, HullArrays, arrange, room_of
from taichi_soft.bodies.plasticity import Plasticity
from taichi_soft.bodies.short_steps import warn_of_short_steps
from taichi_soft.bodies.skin import Skin, bound
from taichi_soft.bodies.stability import RIGID_STEP, StableStep, stable_step
from taichi_soft.bodies.tearing import Tearing
from taichi_soft.cages import tetrahedra_of
from taichi_soft.cages.hull import Hull, as_hull
from taichi_soft.core.checks import as_count, as_indices, as_positive, as_rotation, as_vector
from taichi_soft.core.conflicts import (
    ANISOTROPIC_FAILURE,
    EDGE_LAW_CAGE,
    EDGE_LAW_CUTS,
    EDGE_LAW_FLOW,
    HULL_CUTS,
    HULL_ITSELF,
    NO_TETRAHEDRA,
)
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.errors import MaterialError, MeshError, OptionError
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.residue import rounding_error, weighted_sum
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
from taichi_soft.elements.materials import (
    AnisotropicMaterial,
    AnyMaterial,
    Material,
    RigidMaterial,
    RodMaterial,
    ShellMaterial,
    SpringMaterial,
)
from taichi_soft.meshing import BodyMesh, TetMesh
from taichi_soft.meshing.arrays import read_only
from taichi_soft.meshing.cage_mesh import CageMesh
from taichi_soft.meshing.creases import DEFAULT_CREASE, split_at_creases
from taichi_soft.meshing.flat_vertices import without_flat_vertices
from taichi_soft.meshing.rigid_mesh import RigidMesh, require_closed
from taichi_soft.meshing.surface import Surface, joined
from taichi_soft.meshing.surfaces import Up, assumed_up, read_surfaces

_log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

DAMPING_INTERVAL = 0.5
"""Product of the longest time between two dampings of vibrations and the angular frequency of the first
mode. With this value, vibrations are damped about 12 times per period."""

MAX_BOX_DIFFERENCE = 0.25
"""Largest difference between the bounding boxes of a level of detail and of the finest level. The
difference is the largest distance between corresponding sides, as a fraction of the longest side of the
finest level's box."""

REST_WIDTH = 11
"""Number of columns of the initial state of a vertex: see `SoftBodyAsset.placed`."""


@dataclass(frozen=True, eq=False)
class SoftBodyAsset:
    """Immutable data of one kind of body, shared by its bodies in all worlds.

    Args:
        mesh: rest shape. A `ParticleMesh` (rope, cloth) needs law "springs", a `ShellMesh` law "shell", a
            `RodMesh` law "rod".
        material: constants in SI units; a `SpringMaterial` for a `ParticleMesh`, a `ShellMaterial` for a
            `ShellMesh`, a `RodMaterial` for a `RodMesh`.
        law: one of `LAWS`. Laws on tetrahedra: "virial" (thesis 6.3), "face" (6.2), "st_venant_kirchhoff",
            "neo_hookean". Laws along edges: "springs" (3.4), "volume_springs" (chapter 5), "cmpm", "cmpm2",
            "best_fitting_plane", "split_ring_plane", "tilted_plane" and "tilted_plane_printed" (chapter 4).
            None: "springs" for a `SpringMaterial`; "shell" for a `ShellMaterial`; "rod" for a `RodMaterial`;
            "virial" for an `AnisotropicMaterial`, or if you pass `strain`, or `flips` other than "recover";
            else "neo_hookean".
        strain: "linear" (eq. 6.7) or "exact" (square root of U^2); None: the law's default.
        flips: "tolerant" (a mirrored tetrahedron is also at rest, as in the thesis), "recover" or "off";
            None: the law's default. A law that derives from an energy accepts only its default.
        damping_model: "edge" (eq. 3.9) or "tet_mean" (rejected in section 6.4, because it stops rotation).
        pinned: vertices that stay in place.
        contact: contact properties of the surface, used in a world with colliders or soft contact.
        spare_vertices: number of vertices that cuts and tears can add; 0 for a body that is never cut. Needs
            a law on tetrahedra. A cut through a body of n vertices adds about n^(2/3).
        plasticity: permanent deformation; None for an elastic body. Needs a law on tetrahedra and a
            `Material`.
        tearing: strength above which the body tears; None for no tearing. Needs spare vertices and a
            `Material`.
        skin: surface to draw instead of the surface of the tetrahedra: a file, a trimesh.Trimesh or a Scene,
            as for `read_surfaces`. See `Body.render_meshes`.
        hull: contact surface. None: the surface of the tetrahedra. A number from 12 to 20,000: that many
            points of the skin, connected by triangles. True: an automatic number of points. A surface, as for
            `read_surfaces`: this surface. See docs/artists-mesh.md. Needs tetrahedra; not possible with spare
            vertices or self-contact.
        coarser: levels of detail for `Body.set_level`: assets of the same body, each with fewer tetrahedra
            than the asset before. `with_coarser` makes such assets. Not possible with spare vertices or
            plasticity.
    Raises: MeshError, MaterialError or OptionError for bad input.
    Example:
        crate = SoftBodyAsset(box((0.4, 0.4, 0.4), (3, 3, 3)), jelly, contact=Contact(friction=0.8))
        arena = World()
        arena.reserve(crate, 10)  # slots for ten crates
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
        if self.spare_vertices and not model.has_tets:
            raise OptionError(EDGE_LAW_CUTS.message(f"law {self.law!r}"))
        if self.tearing is not None:
            self._require_tears(model)
        if self.plasticity is not None:
            self._require_flow(model)
        surfaces = () if isinstance(self.skin, tuple) and not self.skin else read_surfaces(self.skin)
        if surfaces and not isinstance(self.mesh, TetMesh):
            raise MeshError(NO_TETRAHEDRA.message(repr(self.mesh), "skins"))
        if model.has_bonds and isinstance(self.mesh, CageMesh):
            raise OptionError(EDGE_LAW_CAGE.message(f"law {self.law!r}"))
        pinned = read_only(as_indices(self.pinned, "pinned", len(self.mesh.vertices)))
        require_size(self.mesh)
        description = BodyDescription(self.mesh, self.material, model, pinned)
        _ = description.bonds  # computed now, because a pairwise law can reject the mesh
        _ = description.shells, description.rods
        object.__setattr__(self, "pinned", pinned)
        object.__setattr__(self, "description", description)
        object.__setattr__(self, "skin", surfaces)
        outer = len(self.mesh.surface_vertices) if isinstance(self.mesh, TetMesh) else 0
        if isinstance(self.mesh, RigidMesh):
            self._require_rigid()
            object.__setattr__(self, "hull", Hull(self.mesh.points, self.mesh.triangles))
        object.__setattr__(self, "hull", as_hull(self.hull, surfaces, outer))
        if self.hull is not None:
            self._require_hull()
        if not (self.contact.faces or self.hull or len(self.mesh.surface)):
            raise OptionError(
                "a body without triangles touches with its edges: leave out Contact(faces=False)"
            )
        object.__setattr__(self, "coarser", self._checked_levels(self.coarser))

    def _checked_levels(self, coarser: object) -> tuple[SoftBodyAsset, ...]:
        """Check and return the levels of detail of this asset. Raises: OptionError, MeshError."""
        if not isinstance(coarser, (tuple, list)) or not all(
            isinstance(each, SoftBodyAsset) for each in coarser
        ):
            raise OptionError(f"coarser must be a tuple of assets, got {coarser!r}")
        if coarser and (self.spare_vertices or self.plasticity is not None):
            raise OptionError(
                "an asset with spare_vertices, tearing or plasticity has no levels of detail: leave out "
                "coarser"
            )
        for level, each in enumerate(coarser, start=1):
            if each.coarser or each.spare_vertices or each.plasticity is not None:
                raise OptionError(f"level {level} must not have levels, spare_vertices or plasticity")
            if each.description.model != self.description.model or each.contact != self.contact:
                raise OptionError(f"level {level} must have the law and the contact of the finest level")
            if each.hull is not self.hull and digest_of(each.hull) != digest_of(self.hull):
                raise OptionError(f"level {level} must have the hull of the finest level")
            if not _are_same(each.skin, self.skin):
                raise OptionError(
                    f"level {level} must have the skin of the finest level: make it by with_coarser"
                )
            if not self.description.model.has_tets:
                raise OptionError(
                    f"law {self.law!r} has no levels of detail, because it needs no tetrahedra: use one on "
                    "tetrahedra, such as 'virial'"
                )
            self._require_coarser((self, *coarser)[level - 1], each, level)
        return tuple(coarser)

    def _require_coarser(self, before: SoftBodyAsset, asset: SoftBodyAsset, level: int) -> None:
        """Check that a level is coarser than the level before and has the same shape. Raises: MeshError."""
        room, needed = room_of(self.arrays, 0), room_of(asset.arrays, 0)
        if len(asset.mesh.tets) >= len(before.mesh.tets) or any(
            n > m for n, m in zip(needed, room, strict=True)
        ):
            raise MeshError(
                f"level {level}: {len(asset.mesh.tets)} tetrahedra and {needed[0]} vertices are not fewer "
                f"than the {len(before.mesh.tets)} and {len(before.mesh.vertices)} of the level before: use "
                "fewer cells, or no smaller cells around thin limbs (from_surface, refine=0)"
            )
        (low, high), (own_low, own_high) = (
            (each.mesh.vertices.min(axis=0), each.mesh.vertices.max(axis=0)) for each in (self, asset)
        )
        size = float((high - low).max())
        if max(np.abs(own_low - low).max(), np.abs(own_high - high).max()) > MAX_BOX_DIFFERENCE * size:
            raise MeshError(
                f"level {level} lies from {own_low.round(4).tolist()} to {own_high.round(4).tolist()} m, the "
                f"finest from {low.round(4).tolist()} to {high.round(4).tolist()}: it must be the same body"
            )

    @property
    def levels(self) -> tuple[SoftBodyAsset, ...]:
        """All levels of detail, from the finest, which is this asset, to the coarsest."""
        return (self, *self.coarser)

    def with_coarser(self, *meshes: TetMesh) -> SoftBodyAsset:
        """Return a copy of the asset with a level of detail for each of these meshes.

        The materials of the levels are calibrated so that mass and lowest frequencies are the same as for the
        finest level. The calibration takes seconds for each level.
        Args:
            meshes: rest shapes, each with fewer tetrahedra than the mesh before.
        Raises: MeshError for a mesh that is not coarser; MaterialError unless the material is a `Material`
            with one number for each constant; OptionError for spare vertices, tearing, plasticity or a law
            along edges.
        """
        material = self.material
        if not isinstance(material, Material) or any(
            np.ndim(getattr(material, name)) for name in ("young", "poisson", "density")
        ):
            raise MaterialError("levels of detail need a Material with one number for each constant")
        plain = {
            name: getattr(self, name)
            for name in ("law", "strain", "flips", "damping_model", "contact", "skin", "hull")
        }
        levels = []
        for mesh in meshes:
            if not isinstance(mesh, TetMesh):
                raise MeshError(f"a level of detail must be a TetMesh, got {mesh!r}")
            offsets = mesh.vertices[:, None] - self.mesh.vertices[self.description.pinned]
            pinned = np.unique((offsets**2).sum(axis=2).argmin(axis=0)) if offsets.shape[1] else ()
            levels.append(SoftBodyAsset(mesh, material, pinned=pinned, **plain))
        self._checked_levels(levels)
        # All checks come first, because the calibration takes seconds.
        materials = calibrated(self.description, [each.description for each in levels])
        fitted = (
            replace(each, material=calibrated_material)
            for each, calibrated_material in zip(levels, materials, strict=True)
        )
        return replace(self, coarser=tuple(fitted))

    def _require_hull(self) -> None:
        if not isinstance(self.mesh, TetMesh):
            raise MeshError(NO_TETRAHEDRA.message(repr(self.mesh), "hulls"))
        if self.spare_vertices:
            raise OptionError(HULL_CUTS.message())
        if self.contact.itself:
            raise OptionError(HULL_ITSELF.message())

    def _require_rigid(self) -> None:
        """Check that a rigid body has no options of deformable bodies. Raises: OptionError."""
        if self.hull is not None:
            raise OptionError("a rigid body is its own hull: leave out hull")
        for name in ("plasticity", "tearing", "spare_vertices", "coarser"):
            if getattr(self, name):
                raise OptionError(f"a rigid body does not deform: leave out {name}")

    def _require_tears(self, model: ElementModel) -> None:
        if not isinstance(self.tearing, Tearing):
            raise OptionError(f"tearing must be a Tearing or None, got {self.tearing!r}")
        if self.spare_vertices == 0:
            raise OptionError("tearing needs spare_vertices: a tear copies vertices")
        if model.is_anisotropic:
            raise MaterialError(ANISOTROPIC_FAILURE.message(feature="tearing"))

    def _require_flow(self, model: ElementModel) -> None:
        if not isinstance(self.plasticity, Plasticity):
            raise OptionError(f"plasticity must be a Plasticity or None, got {self.plasticity!r}")
        if not model.has_tets:
            raise OptionError(EDGE_LAW_FLOW.message(f"law {self.law!r}"))
        if model.is_anisotropic:
            raise MaterialError(ANISOTROPIC_FAILURE.message(feature="plasticity"))

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
        """Make a body from an artist's mesh: a cage of tetrahedra with the mesh as its skin.

        The surface can have holes, flipped faces, inner walls and parts that overlap: see
        `taichi_soft.cages`. The body has the mass, centre and inertia of the solid that the surface encloses.
        Args:
            surface: path of a .glb, .gltf, .obj, .ply, .stl or .off file, a trimesh.Trimesh or Scene, or
                (vertices (n, 3) [m], triangles (m, 3)).
            material: material of the solid.
            cells: number of cells of the cage along the longest side; 10 if neither `cells` nor `cell_size`
                is given. Several numbers, the largest first, make levels of detail: see `with_coarser`.
            cell_size: edge of a cell [m], instead of `cells`.
            method: mesher. "lattice" accepts every surface, needs no other package and gives the longest
                substeps. "ftetwild" and "tetgen" fill the surface in a separate process. "ftetwild" (extra
                `ftetwild`: fTetWild, MPL-2.0) follows the surface within a twentieth of a cell, and its
                result differs from run to run. "tetgen" (extra `tetgen`) keeps every triangle of a closed
                surface. TetGen's licence, the AGPL, requires you to publish the source of everything that
                you ship or serve with it.
            time_limit: time after which the process of "ftetwild" or "tetgen" is killed [s]; None: 120.
            refine: for "lattice", how often cells can be halved around limbs and sheets thinner than about a
                sixteenth of a cell, which the cage would otherwise omit: 0 to 3; None: 1. Each halving also
                halves the substep. Parts that are still omitted are drawn, but neither bend nor collide. The
                log reports halvings and omitted parts, with the `cell_size` that keeps the parts.
            up: axis that points up in the file, "y" or "z". None: the usual axis of the file type, "y" for
                .glb, .gltf and .obj, and "z" for the other types.
            center: True moves the centre of the bounding box to the origin. Files in geographic coordinates,
                kilometres away from the origin, need this because positions are 32-bit numbers.
            scale: length of the file's unit [m]: 0.001 for millimetres.
            options: further arguments of `SoftBodyAsset`. If you pass `skin`, it is drawn instead of the
                surface.
        The logger `taichi_soft` reports assumptions about the file, repairs and omissions.
        Raises: MeshError, with a suggested fix, for a surface that cannot be read or encloses nothing, and
            for a process that crashes or takes too long; OptionError for cells out of range, with the memory
            that they would need; MissingExtraError if the package of the method is not installed.
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
            raise OptionError("cells is empty: pass a number, or several for levels of detail")
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
            for note in made.notes:
                _log.warning("%s", note)
            meshes.append(made.mesh)
        asset = cls(meshes[0], material, **{"skin": surfaces, **options})
        return asset.with_coarser(*meshes[1:]) if meshes[1:] else asset

    @classmethod
    def rigid(
        cls,
        surface: Any,
        *,
        mass: float | None = None,
        density: float | None = None,
        contact: Contact = DEFAULT_CONTACT,
        skin: Any = (),
    ) -> SoftBodyAsset:
        """Make a rigid body: it has the mass, centre and inertia of the solid that a surface encloses.

        Four particles carry the body, so that everything that acts on particles also acts on it.
        Args:
            surface: closed surface: a `TetMesh` such as `box` makes, or a surface as for `read_surfaces`.
                Several surfaces make a compound; where they overlap, the solid counts twice.
            mass: [kg]. Give either the mass or the density.
            density: [kg/m^3].
            contact: friction, thickness and groups of the surface.
            skin: surface to draw, as for `SoftBodyAsset`; () for the surface itself.
        Raises: MeshError for a surface that is not closed; OptionError unless one of `mass` and `density` is
            given; MaterialError for a density out of range.
        Example:
            crate = SoftBodyAsset.rigid(box((0.5, 0.5, 0.5)), mass=10.0)
        """
        if (mass is None) == (density is None):
            raise OptionError(f"give either mass or density, got mass={mass!r} and density={density!r}")
        drawn: Any = skin
        if isinstance(surface, TetMesh):
            points, triangles = surface.vertices, surface.surface.astype(np.int64)
        else:
            read = read_surfaces(surface)
            drawn = read if drawn == () else drawn
            points, triangles = joined(read)
        # Files often have several vertices at a corner, one for each normal.
        places, number = np.unique(points, axis=0, return_inverse=True)
        faces = number.reshape(-1)[triangles]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        require_closed(faces)
        mesh = RigidMesh(*without_flat_vertices(places, faces))
        if mass is not None:
            density = as_positive(mass, "mass", "kg") / float(mesh.vertex_volumes.sum())
        assert density is not None
        if drawn == ():
            copied, corners = split_at_creases(mesh.points, mesh.triangles, DEFAULT_CREASE)
            drawn = (mesh.points[copied], corners)
        return cls(mesh, RigidMaterial(density), contact=contact, skin=drawn)

    @cached_property
    def skins(self) -> tuple[Skin, ...]:
        """Surfaces of the skin, bound to the tetrahedra; empty if the asset has no skin."""
        if not self.skin:
            return ()
        assert isinstance(self.mesh, TetMesh)
        return bound(self.mesh, self.skin)

    @cached_property
    def bound_hull(self) -> BoundHull | None:
        """Hull, bound to the tetrahedra; None if the asset has no hull."""
        if self.hull is None:
            return None
        assert isinstance(self.mesh, TetMesh)
        return bind(self.mesh, self.hull)

    @cached_property
    def arrays(self) -> BodyArrays:
        """Arrays of the body in kernel order. They are cached, because they are slow to compute."""
        arrays = replace(arrange(self.description), has_faces=self.contact.faces)
        hull = self.bound_hull
        if hull is None:
            return arrays
        carriers = arrays.rank[hull.vertices]
        points = (hull.weights[:, :, None] * arrays.rest_position[carriers]).sum(axis=1)
        edges, sharp = find_contact_edges(points, hull.triangles, np.zeros((0, 2), dtype=np.int32))
        rows = HullArrays(carriers, hull.weights, hull.triangles)
        radii = self.mesh.radii if isinstance(self.mesh, RigidMesh) else None
        slim = has_slim_edges(points, edges, sharp)
        return replace(arrays, hull=rows, contact_edges=edges, sharp_edges=sharp, is_slim=slim, radii=radii)

    @property
    def surface(self) -> NDArray[np.int32]:
        """Triangles of the surface, (f, 3): vertices of the mesh, or points of a rigid body's mesh."""
        mesh = self.mesh
        return np.asarray(mesh.triangles if isinstance(mesh, RigidMesh) else mesh.surface)

    def touching_points(self, x: Floats) -> Floats:
        """Return the positions of the points that can touch colliders, (k, 3) [m].

        These points are the points of the hull, or, if there is no hull, the vertices of the surface.

        Args:
            x: positions of the vertices, (n, 3) [m].
        """
        hull = self.bound_hull
        if hull is None:
            return x[outer_vertices(self.mesh)]
        return np.asarray((hull.weights[:, :, None] * x[hull.vertices]).sum(axis=1))

    @cached_property
    def stable_step(self) -> StableStep:
        """Estimate of the largest stable substep."""
        if self.description.is_rigid:
            return RIGID_STEP
        return stable_step(self.mesh, self.material, self.description.model)

    @cached_property
    def first_frequency(self) -> float:
        """Angular frequency of the slowest vibration of the free body [rad/s], at most 20 % too high.

        The frequency is 0 for ropes, cloth, shells and rods, which have no damping ratio.
        """
        has_none = not isinstance(self.mesh, TetMesh) or self.description.is_rigid
        return 0.0 if has_none else first_frequency(self.description)

    @cached_property
    def guessed_frequency(self) -> float:
        """Fast estimate of `first_frequency` [rad/s]. It is 0 for all laws along edges, shells and rods."""
        return 0.0 if self.description.is_rigid else guessed_frequency(self.description)

    def vibration_row(self, body: BodyDescription) -> tuple[float, float]:
        """Return the decay rate of a body's vibrations [1/s], and the longest time between two dampings [s].

        The body can be cut or have another material. If the material differs, the frequency of the first mode
        is scaled by the square root of mean stiffness over mean density.
        Args:
            body: description of a body of this asset.
        """
        material = body.material
        if (
            isinstance(material, SpringMaterial | ShellMaterial | RodMaterial)
            or material.damping_ratio * self.first_frequency == 0.0
        ):
            return 0.0, 1.0
        frequency = self.first_frequency
        if material is not self.material:
            frequency *= float(np.sqrt(_mean_stiffness(body) / _mean_stiffness(self.description)))
        return 2.0 * material.damping_ratio * frequency, DAMPING_INTERVAL / max(frequency, 1e-6)

    def kind_row(self, *, is_implicit: bool) -> tuple[float, ...]:
        """Return the row of a body of this asset in the argument `kinds` of `BodyFields.load`.

        The row contains `body_edge`, `body_stride`, `body_sound_speed` and `vibration_row`.

        Args:
            is_implicit: True for implicit Euler, which has no largest stable substep. The stride is then 0.
        """
        speed = self.description.sound_speed
        stride = 0.0 if is_implicit else self.stable_step.recommended * speed
        return self.surface_row[2], stride, speed, *self.vibration_row(self.description)

    @property
    def radius(self) -> float:
        """Radius with which a rope or a rod touches colliders [m]; 0 for bodies with a surface."""
        return 0.0 if len(self.mesh.surface) else 0.5 * self.surface_row[1]

    @cached_property
    def surface_row(self) -> tuple[float, float, float]:
        """Friction, thickness [m] and mean edge length [m] of the contact surface.

        The contact surface is the hull, or, if there is no hull, the surface of the mesh. If the mesh has no
        triangles, the mean is over all edges.
        """
        corners = self.mesh.surface if len(self.mesh.surface) else self.mesh.edges
        ends = self.mesh.vertices[np.concatenate([corners[:, :2], corners[:, -2:]])]
        edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
        if self.bound_hull is not None:
            edge = self.bound_hull.mean_edge
        thickness = self.contact.thickness
        if thickness is None:
            thickness = DEFAULT_THICKNESS * edge
            if isinstance(self.material, ShellMaterial):
                thickness = float(np.mean(self.material.thickness))
            if isinstance(self.material, RodMaterial):
                thickness = 2.0 * float(np.mean(self.material.radius))
            if isinstance(self.mesh, RigidMesh):
                thickness = RIGID_THICKNESS * float(np.ptp(self.mesh.points, axis=0).min())
        return self.contact.friction, thickness, edge

    @cached_property
    def center_of_mass(self) -> Floats:
        """Centre of mass of the mesh, (3,) [m]."""
        masses = self.description.masses
        return np.asarray(weighted_sum(masses, self.mesh.vertices) / masses.sum())

    @cached_property
    def rest_rows(self) -> Floats32:
        """State of each vertex at rest, (n, REST_WIDTH): see `placed`."""
        rows = np.zeros((len(self.mesh.vertices), REST_WIDTH), dtype=np.float32)
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
        """Return the initial state of each vertex of a body in a world, (n, REST_WIDTH).

        The columns are position, velocity, inverse mass, mass, and rounding error of the position.

        Args:
            position, rotation, velocity, angular_velocity: as for `World.spawn`.
            floor: height of the floor [m], or None.
        Raises: OptionError for bad values, a vertex that is too fast, or a position that is out of range or
            below the floor.
        """
        origin, rotation_matrix = as_vector(position, "position", "m"), as_rotation(rotation)
        start_velocity = as_vector(velocity, "velocity", "m/s", VELOCITY_LIMIT)
        spin = as_vector(angular_velocity, "angular_velocity", "rad/s")
        x = turned(self.mesh.vertices, rotation_matrix) + origin
        self._check_position(x, origin, floor)
        rows: Floats32 = self.rest_rows.copy()
        rows[:, :3] = x
        rows[:, 8:] = rounding_error(x)
        rows[:, 3:6] = start_velocity
        if spin.any():
            a, b, c = spin
            spin_matrix = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])  # spin x r = spin_matrix @ r
            center = turned(self.center_of_mass[None], rotation_matrix) + origin
            rows[:, 3:6] += turned(x - center, spin_matrix)
            fastest = float(np.abs(rows[:, 3:6]).max())
            if not fastest < VELOCITY_LIMIT:
                raise OptionError(
                    f"angular_velocity={spin.tolist()} rad/s gives a vertex a speed of {fastest:.4g} m/s: "
                    f"keep it below {VELOCITY_LIMIT:g}"
                )
        rows[self.description.pinned, 3:6] = 0.0
        return rows

    def _check_position(self, x: Floats, origin: Floats, floor: float | None) -> None:
        if not np.abs(x).max() < POSITION_LIMIT:
            raise OptionError(
                f"position puts the body beyond {POSITION_LIMIT:g} m: place it nearer to the origin"
            )
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
    """Return the mean stiffness of a body divided by its mean density, up to a constant factor [m^2/s^2]."""
    mesh, material = body.mesh, body.material
    assert isinstance(mesh, TetMesh)
    assert isinstance(material, Material | AnisotropicMaterial)
    if isinstance(material, Material):
        stiffness = body.per_tet("young")
    else:
        stiffness = np.trace(body.stiffness_matrices(), axis1=1, axis2=2)
    return float((mesh.volumes * stiffness).sum() / (mesh.volumes * body.per_tet("density")).sum())
