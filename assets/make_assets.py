"""Make the mesh files in this folder. All random choices are seeded, so the files are reproducible.

The script needs `pip install "taichi-soft[voronoi]"`. For each file, it prints a row of the table in
README.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from layouts import disc, plate_with_hole, rod
from unstructured import Cloud, polish, spread_on_sphere, triangulate

from taichi_soft.meshing import TetMesh, box, extrude, save_mesh, voxels

FOLDER = Path(__file__).parent


def sphere() -> TetMesh:
    """Make the ball of section 6.6: 381 particles and 4 m^3, fine at the surface and coarse inside."""
    total, inner, depth, seed = 381, 17, 0.5, 2
    # In the score of a tetrahedron, a height of 1 m counts as this many degrees (see `worth`).
    angle_per_height = 200.0
    outer = spread_on_sphere(total - inner - 1, seed)
    shell = depth * spread_on_sphere(inner, seed + 1)
    free = np.full(total, np.nan)
    on_sphere = np.r_[np.ones(len(outer)), free[len(outer) :]]
    cloud = Cloud(np.concatenate([outer, shell, np.zeros((1, 3))]), on_sphere, free, free)
    tets = triangulate(cloud)
    for round_seed in range(4):
        polish(cloud, tets, round_seed, 2000, angle_per_height)
        tets = triangulate(cloud)
    polish(cloud, tets, 9, 6000, angle_per_height)
    mesh = TetMesh(cloud.points, tets)
    return mesh.scaled(float(np.cbrt(4.0 / mesh.volume)))


def cylinder_long() -> TetMesh:
    """Make the cylinder that is stretched in section 6.6: 4 m long, 1.5 m in diameter."""
    cap = [(8, 0.45, 0.1), (2, 0.15, 0.0)]
    points, tets = rod(4.0, 0.75, around=13, bands=[3, 2, 2, 2, 2, 3], cap=cap, axis=1.5)
    return TetMesh(points, tets, fix_orientation=True)


def cylinder_flat() -> TetMesh:
    """Make the cylinder of figure 6.4, whose flat ends are moved apart or sideways: 0.5 m high, 2 m wide."""
    points, triangles = disc([(6, 0.27, 0.0), (12, 0.53, 0.0), (17, 0.78, 0.0), (18, 1.0, 0.0)])
    return extrude(points, triangles, layers=2, height=0.5)


def cube() -> TetMesh:
    """Make the cube of figures 5.1 and 5.2, with edges of 1 m."""
    return box((1.0, 1.0, 1.0), (4, 4, 4))


def bars() -> TetMesh:
    """Make three crossed bars. Each bar is 13 times as long as thick, so that it bends visibly."""
    mask = np.zeros((26, 26, 26), dtype=bool)
    mask[:, 12:14, 12:14] = mask[12:14, :, 12:14] = mask[12:14, 12:14, :] = True
    return voxels(mask, 0.1)


def beam_with_hole() -> TetMesh:
    """Make a beam along x with a round hole along z. This larger body is for timing."""
    points, triangles = plate_with_hole(3.0, 1.0, 0.25, spacing=0.117)
    return extrude(points, triangles, layers=5, height=0.6)


BODIES: dict[str, Callable[[], TetMesh]] = {
    make.__name__: make for make in (sphere, cylinder_long, cylinder_flat, cube, bars, beam_with_hole)
}


def table_row(name: str, mesh: TetMesh) -> str:
    """Format the properties of a mesh as a row of the table in README.md."""
    size = " x ".join(f"{edge:.3g}" for edge in mesh.bounds[1] - mesh.bounds[0])
    quality = mesh.quality
    return (
        f"| `{name}.npz` | {len(mesh.vertices)} | {len(mesh.tets)} | {size} | {mesh.volume:.4f} "
        f"| {quality.min_dihedral.min():.1f} | {quality.shortest_edge:.3f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which to make: {', '.join(BODIES)} (all)")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for the files (this one)")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(BODIES))
    if unknown:
        parser.error(f"unknown name {unknown[0]!r}: choose from {', '.join(BODIES)}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or BODIES:
        mesh = BODIES[name]()
        save_mesh(mesh, arguments.out / f"{name}.npz")
        print(table_row(name, mesh), flush=True)


if __name__ == "__main__":
    main()
