# /// script
# requires-python = ">=3.10"
# dependencies = [
#     "fast-simplification==0.2.0",
#     "numpy>=2",
#     "pillow>=12",
#     "scikit-image==0.26.0",
#     "scipy>=1.15",
#     "trimesh>=5",
#     "xatlas==0.0.11",
# ]
# ///
"""Make `elephant.glb`: a sitting toy elephant, 0.5 m high, with a painted texture.

Run `uv run assets/make_elephant.py`, or install the packages above and run `python assets/make_elephant.py`.
With the same versions of the packages, the script makes the same file. In this script, the unit of length is
about the height of the toy, z points up, and the elephant faces the direction -y. In the file, y points up,
as glTF requires.

The shape is the zero level of a function of space that blends round parts. The colours are also a function of
space. This function is evaluated at each pixel of the texture.
"""

from __future__ import annotations

import io
from pathlib import Path

import fast_simplification
import numpy as np
import trimesh
import xatlas
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from skimage.measure import marching_cubes

Floats = NDArray[np.float64]

FILE = Path(__file__).parent / "elephant.glb"
HEIGHT = 0.5  # [m]
TRIANGLES, ROUNDS = 14000, 12  # number of triangles, number of smoothing rounds
GRID = 0.011  # edge of a cell of marching cubes
PIXELS, MARGIN, QUALITY = 1024, 6, 90  # texture: edge and margin around charts [pixels], JPEG quality
LOW, HIGH = np.array([-0.85, -0.85, -0.1]), np.array([0.85, 0.5, 1.15])  # corners of the sampled box

EYES = np.array([[-0.105, -0.262, 0.765], [0.105, -0.262, 0.765]])
EYE = 0.036  # radius
EAR, EAR_SIZE = np.array([0.40, 0.02, 0.735]), np.array([0.235, 0.0, 0.265])  # centre, half axes
EAR_TURN, EAR_TILT = 0.45, 0.22  # rotation about z (to the front), about y (outwards) [rad]
EAR_THICKNESS = 0.052  # half thickness
TRUNK = np.array(
    [
        [0, -0.20, 0.70],
        [0, -0.34, 0.64],
        [0, -0.43, 0.53],
        [0, -0.48, 0.42],
        [0, -0.565, 0.365],
        [0, -0.64, 0.41],
    ]
)
TRUNK_RADII = (0.125, 0.105, 0.085, 0.073, 0.066, 0.064)
FEET = np.array([[-0.27, -0.46, 0.125], [0.27, -0.46, 0.125]])
HANDS = np.array([[-0.40, -0.27, 0.36], [0.40, -0.27, 0.36]])

BODY, BELLY, INNER_EAR = (0.66, 0.76, 0.86), (0.97, 0.94, 0.88), (0.98, 0.66, 0.68)
CHEEK, NAIL, SOLE = (0.99, 0.62, 0.62), (0.99, 0.95, 0.90), (0.98, 0.72, 0.70)
BLACK, WHITE, TUFT = (0.05, 0.05, 0.08), (1.0, 1.0, 1.0), (0.44, 0.54, 0.68)
SPOT = (0.54, 0.66, 0.80)


def blend(a: Floats, b: Floats, width: float) -> Floats:
    """Return the distance to the union of two solids, rounded over `width` at their junction.

    Args:
        a, b: distances to the solids, negative inside.
    """
    h = np.clip(0.5 + 0.5 * (b - a) / width, 0.0, 1.0)
    return b + (a - b) * h - width * h * (1.0 - h)


def ellipsoid(p: Floats, middle: tuple[float, ...], axes: tuple[float, ...]) -> Floats:
    """Return the approximate distance of points (..., 3) from an ellipsoid, (...); negative inside."""
    q = (p - np.array(middle)) / np.array(axes)
    far, slope = np.linalg.norm(q, axis=-1), np.linalg.norm(q / np.array(axes), axis=-1)
    return far * (far - 1.0) / np.maximum(slope, 1e-9)


def cone(p: Floats, a: Floats, b: Floats, start: float, end: float) -> Floats:
    """Return the approximate distance from a round rod from `a` to `b` with end radii `start` and `end`."""
    along = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(p - a - along[..., None] * (b - a), axis=-1) - (start + (end - start) * along)


def ear_axes(p: Floats) -> Floats:
    """Convert points to coordinates in the axes of the right ear: sideways, to the front, and up, (..., 3).

    Points on the left side are mirrored, because the left ear is a mirror image of the right ear.
    """
    q = np.stack([np.abs(p[..., 0]), p[..., 1], p[..., 2]], axis=-1) - EAR
    c, s = np.cos(EAR_TURN), np.sin(EAR_TURN)
    across, front, up = c * q[..., 0] - s * q[..., 1], -s * q[..., 0] - c * q[..., 1], q[..., 2]
    c, s = np.cos(EAR_TILT), np.sin(EAR_TILT)
    return np.stack([c * across - s * up, front, s * across + c * up], axis=-1)


def ear(p: Floats) -> Floats:
    """Return the distance of points from both ears: dished discs with round rims."""
    x, y, z = np.moveaxis(ear_axes(p), -1, 0)
    a, b = EAR_SIZE[0] - EAR_THICKNESS, EAR_SIZE[2] - EAR_THICKNESS
    far = np.sqrt((x / a) ** 2 + (z / b) ** 2)
    flat = np.maximum((far - 1.0) * min(a, b), 0.0)
    hollow = y - 0.09 * (far**2 - 0.6)  # the rim is in front of the centre
    return np.sqrt(flat**2 + hollow**2) - EAR_THICKNESS


def solid(p: Floats) -> Floats:
    """Return the approximate distance of points (..., 3) from the elephant, (...); negative inside."""
    mirrored = np.stack([np.abs(p[..., 0]), p[..., 1], p[..., 2]], axis=-1)
    body = ellipsoid(p, (0, 0.02, 0.29), (0.275, 0.245, 0.30))
    body = blend(body, ellipsoid(p, (0, -0.07, 0.25), (0.235, 0.22, 0.22)), 0.10)
    head = blend(ellipsoid(p, (0, -0.05, 0.75), (0.255, 0.235, 0.225)), ear(p), 0.05)
    trunk = np.full(p.shape[:-1], 9.0)
    for k in range(len(TRUNK) - 1):
        trunk = blend(trunk, cone(p, TRUNK[k], TRUNK[k + 1], TRUNK_RADII[k], TRUNK_RADII[k + 1]), 0.04)
    head = blend(head, trunk, 0.07)
    tufts = [(-0.03, -0.10, 1.03), (0.0, -0.04, 1.06), (0.035, 0.02, 1.03)]
    for tip in tufts:
        head = blend(head, cone(p, np.array([0, -0.04, 0.94]), np.array(tip), 0.045, 0.026), 0.03)
    whole = blend(body, head, 0.09)
    whole = blend(whole, cone(mirrored, np.array([0.17, -0.04, 0.47]), HANDS[1], 0.088, 0.098), 0.06)
    whole = blend(whole, cone(mirrored, np.array([0.15, -0.10, 0.14]), FEET[1], 0.12, 0.128), 0.06)
    whole = blend(whole, cone(p, np.array([0, 0.22, 0.16]), np.array([0.0, 0.40, 0.21]), 0.04, 0.034), 0.04)
    whole = blend(whole, ellipsoid(p, (0, 0.43, 0.225), (0.05, 0.055, 0.05)), 0.02)
    eyes = np.linalg.norm(mirrored - EYES[1], axis=-1) - 1.05 * EYE
    return blend(whole, eyes, 0.008)


def gradient(p: Floats) -> Floats:
    """Return the gradient of `solid` at points (n, 3) by central differences, (n, 3)."""
    step = 1e-4 * np.eye(3)
    return np.stack([(solid(p + each) - solid(p - each)) / 2e-4 for each in step], axis=-1)


def surface() -> tuple[Floats, NDArray[np.int64], Floats]:
    """Return the vertices (n, 3), the triangles (m, 3) and the vertex normals (n, 3) of the elephant.

    Marching cubes make a mesh of the surface. The mesh is simplified, smoothed, and projected back onto the
    solid.
    """
    axes = [np.arange(lo, hi, GRID) for lo, hi in zip(LOW, HIGH, strict=True)]
    values = solid(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    points, triangles, _, _ = marching_cubes(values, 0.0, spacing=(GRID,) * 3, gradient_direction="descent")
    points, triangles = fast_simplification.simplify(
        (points + LOW).astype(np.float32), triangles.astype(np.int32), target_count=TRIANGLES
    )
    points = on_solid(points.astype(np.float64))
    edges = trimesh.Trimesh(points, triangles, process=False).edges_unique
    ends, others = np.concatenate([edges, edges[:, ::-1]]).T
    for _ in range(ROUNDS):  # move vertices towards the mean of their neighbours, for regular triangles
        counts = np.bincount(ends, minlength=len(points))[:, None]
        middle = np.stack([np.bincount(ends, points[others, k], len(points)) for k in range(3)], axis=1)
        points = on_solid(points + 0.4 * (middle / counts - points))
    slope = gradient(points)
    return points, triangles, slope / np.linalg.norm(slope, axis=1, keepdims=True)


def on_solid(points: Floats) -> Floats:
    """Project points near the surface onto it, by Newton's method along the gradient."""
    for _ in range(3):
        slope = gradient(points)
        points = points - slope * (solid(points) / np.maximum((slope**2).sum(axis=1), 1e-9))[:, None]
    return points


def soft(distance: Floats, width: float = 0.012) -> Floats:
    """Return 1 for negative and 0 for positive distances, with a smooth transition over `width`."""
    t = np.clip(0.5 - distance / width, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def over(colors: Floats, paint: tuple[float, ...], share: Floats) -> None:
    """Blend a paint over colours (n, 3), in place.

    Args:
        share: opacity of the paint, (n,).
    """
    colors += share[:, None] * (np.array(paint) - colors)


def spots(p: Floats) -> Floats:
    """Return the distance of points from the rims of round spots, (n,); negative inside a spot.

    The spots have several sizes and are spread over the elephant's back and sides.
    """
    rng = np.random.default_rng(5)
    places = rng.uniform([-0.3, -0.1, 0.05], [0.3, 0.35, 1.0], (400, 3))
    kept: list[tuple[Floats, float]] = []
    for place in places[np.abs(solid(places)) < 0.02]:
        radius = rng.uniform(0.022, 0.045)
        if all(np.linalg.norm(place - other) > radius + r + 0.035 for other, r in kept):
            kept.append((place, radius))
    return np.min([np.linalg.norm(p - place, axis=1) - radius for place, radius in kept], axis=0)


def paint(p: Floats) -> Floats:
    """Return the colours of points on the surface, sRGB from 0 to 1, (n, 3)."""
    colors = np.tile(np.array(BODY), (len(p), 1))
    mirrored = np.stack([np.abs(p[:, 0]), p[:, 1], p[:, 2]], axis=1)
    over(colors, SPOT, 0.8 * soft(spots(p)) * soft(-p[:, 1] - 0.03, 0.05) * soft(mirrored[:, 0] - 0.27))
    belly = ellipsoid(p, (0, -0.28, 0.28), (0.165, 0.20, 0.20))
    over(colors, BELLY, soft(belly, 0.03))
    x, y, z = ear_axes(p).T
    far = np.sqrt((x / (EAR_SIZE[0] - 0.06)) ** 2 + (z / (EAR_SIZE[2] - 0.06)) ** 2)
    front = y - 0.09 * ((x**2 + z**2) / (EAR_SIZE[0] - EAR_THICKNESS) ** 2 - 0.6)
    inner = soft(far - 1.0, 0.06) * soft(0.02 - front) * soft(ear(p) - 0.004, 0.016)
    over(colors, INNER_EAR, inner)
    along, beside = on_trunk(p)
    ring = np.abs((along / 0.07) % 1.0 - 0.5) * 0.07
    over(
        colors, TUFT, 0.6 * soft(beside - 0.02) * soft(0.16 - along) * soft(along - 0.5) * soft(ring - 0.006)
    )
    tip = np.linalg.norm(p - (TRUNK[-1] + np.array([0, -0.045, 0.04])), axis=1)
    over(colors, INNER_EAR, soft(tip - 0.042))
    over(colors, CHEEK, 0.75 * soft(np.linalg.norm(mirrored - [0.185, -0.225, 0.665], axis=1) - 0.045, 0.05))
    over(colors, SOLE, soft(np.linalg.norm(mirrored - (FEET[1] + [0.02, -0.125, 0.0]), axis=1) - 0.078))
    for turn in (-0.75, 0.0, 0.75):
        toe = FEET[1] + 0.128 * np.array([np.sin(turn) * 0.75, -0.62, 0.74 * np.cos(turn)])
        over(colors, NAIL, soft(np.linalg.norm(mirrored - toe, axis=1) - 0.032))
        finger = HANDS[1] + 0.098 * np.array([0.62, -0.62, 0.0]) + 0.062 * turn * np.array([-0.4, -0.4, 1.0])
        over(colors, NAIL, soft(np.linalg.norm(mirrored - finger, axis=1) - 0.026))
    over(colors, TUFT, soft(0.955 - p[:, 2], 0.03) * soft(mirrored[:, 0] - 0.12))
    over(colors, TUFT, soft(0.385 - p[:, 1], 0.02))
    brow = np.linalg.norm((mirrored - [0.115, -0.24, 0.845]) * [0.55, 1.0, 1.6], axis=1) - 0.02
    over(colors, TUFT, 0.9 * soft(brow))
    out = np.array([0.25, -0.93, 0.26])
    over(colors, BLACK, soft(np.linalg.norm(mirrored - EYES[1], axis=1) - 1.28 * EYE, 0.008))
    for eye in EYES:  # the light comes from the same side in both eyes
        glint = eye + 1.05 * EYE * out / np.linalg.norm(out) + np.array([-0.014, 0.0, 0.012])
        over(colors, WHITE, soft(np.linalg.norm(p - glint, axis=1) - 0.013, 0.006))
    return np.asarray(colors * weave(p)[:, None])


def on_trunk(p: Floats) -> tuple[Floats, Floats]:
    """Locate points (n, 3) relative to the trunk.

    Returns: position along its centre line, and distance from its surface, (n,) each.
    """
    starts, ways = TRUNK[:-1], np.diff(TRUNK, axis=0)
    shares = np.clip(((p[:, None] - starts) * ways).sum(axis=2) / (ways**2).sum(axis=1), 0.0, 1.0)
    far = np.linalg.norm(p[:, None] - starts - shares[..., None] * ways, axis=2)
    lengths, radii = np.linalg.norm(ways, axis=1), np.array(TRUNK_RADII)
    outside = far - (radii[:-1] + shares * np.diff(radii))
    nearest = np.argmin(outside, axis=1)
    row = np.arange(len(p))
    along = (lengths.cumsum() - lengths)[nearest] + shares[row, nearest] * lengths[nearest]
    return along, outside[row, nearest]


def weave(p: Floats) -> Floats:
    """Return the brightness of the cloth at points (n, 3), (n,). Crossing threads vary by a few per cent."""
    x, y, z = (2 * np.pi / 0.020 * p).T
    return 1.0 + 0.022 * (np.sin(x + z) + np.sin(y - z) + np.sin(x - y))


def texture(points: Floats, triangles: NDArray[np.int64], uv: Floats) -> Image.Image:
    """Paint the texture. Each pixel of a chart gets the colour of its point on the surface."""
    places = np.zeros((PIXELS, PIXELS, 3))
    is_painted = np.zeros((PIXELS, PIXELS), dtype=bool)
    corners = np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)[triangles] * PIXELS - 0.5
    for places_of, (a, b, c) in zip(points[triangles], corners, strict=True):
        low = np.floor(np.min([a, b, c], axis=0) - 1).astype(int).clip(0)
        high = np.ceil(np.max([a, b, c], axis=0) + 2).astype(int).clip(0, PIXELS)
        grid = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="xy"), axis=-1)
        edges = np.array([b - a, c - a]).T
        if abs(np.linalg.det(edges)) < 1e-12:
            continue
        s, t = np.moveaxis((grid - a) @ np.linalg.inv(edges).T, -1, 0)
        shares = np.stack([1.0 - s - t, s, t], axis=-1)
        found = shares.min(axis=-1) >= -0.02
        column, row = grid[found].T
        places[row, column] = shares[found] @ places_of
        is_painted[row, column] = True
    colors = np.tile(np.array(BODY), (PIXELS, PIXELS, 1))
    colors[is_painted] = paint(places[is_painted])
    far, nearest = ndimage.distance_transform_edt(~is_painted, return_indices=True)
    beyond = (far > 0) & (far <= MARGIN)
    colors[beyond] = colors[nearest[0][beyond], nearest[1][beyond]]
    held = io.BytesIO()
    picture = Image.fromarray(np.round(255.0 * colors.clip(0.0, 1.0)).astype(np.uint8))
    picture.save(held, format="JPEG", quality=QUALITY, optimize=True)
    return Image.open(held)


def main() -> None:
    """Write `elephant.glb` and print its properties."""
    points, triangles, normals = surface()
    atlas = xatlas.Atlas()
    atlas.add_mesh(points.astype(np.float32), triangles.astype(np.uint32), normals.astype(np.float32))
    charts, pack = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.max_cost = 4.0
    pack.resolution, pack.padding, pack.bilinear = PIXELS, 2 * MARGIN, True
    atlas.generate(charts, pack)
    source, corners, uv = atlas[0]
    uv = np.asarray(uv, dtype=np.float64)
    uv[:, 1] = 1.0 - uv[:, 1]  # the texture coordinates of trimesh start at the lower left
    corners = np.asarray(corners, dtype=np.int64)
    picture = texture(points[source], corners, uv)
    material = trimesh.visual.material.PBRMaterial(
        name="plush", baseColorTexture=picture, metallicFactor=0.0, roughnessFactor=0.9
    )
    scale, ground = HEIGHT / np.ptp(points[:, 2]), np.array([0.0, 0.0, points[:, 2].min()])
    y_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    mesh = trimesh.Trimesh(
        scale * (points[source] - ground) @ y_up.T,
        corners,
        vertex_normals=normals[source] @ y_up.T,
        visual=trimesh.visual.TextureVisuals(uv=uv, material=material),
        process=False,
    )
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="elephant", node_name="elephant")
    FILE.write_bytes(scene.export(file_type="glb", include_normals=True))
    solid_of_all = trimesh.Trimesh(scale * points, triangles, process=False)
    print(
        f"{FILE.name}: {len(source)} vertices, {len(corners)} triangles, {FILE.stat().st_size / 1e3:.0f} kB, "
        f"{atlas.chart_count} charts, watertight: {solid_of_all.is_watertight}, "
        f"volume {solid_of_all.volume:.4f} m^3, size {np.round(np.ptp(solid_of_all.vertices, axis=0), 3)} m"
    )


if __name__ == "__main__":
    main()
