"""Write USD: one Mesh per clip, with a sample of its points and normals at each frame.

The file contains texture coordinates and the colour of the material. It contains no textures, because a .usdc
cannot embed images.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.bake.clip import Clip, Take
from taichi_soft.bake.clip_materials import visual_of


def write_usd(take: Take, path: Path) -> None:
    """Write the clips as a USD stage: z up, in metres, with one time code per frame."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(take.fps)
    stage.SetFramesPerSecond(take.fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(take.frame_count - 1)
    root = UsdGeom.Xform.Define(stage, "/bake")
    stage.SetDefaultPrim(root.GetPrim())
    names: set[str] = set()
    for number, clip in enumerate(take.clips):
        name = _identifier(clip.name, names)
        _write_clip(UsdGeom.Mesh.Define(stage, f"/bake/{name}"), clip, number, take.frame_count)
    stage.GetRootLayer().Save()


def _identifier(name: str, taken: set[str]) -> str:
    """Convert a name to a USD identifier (letters, digits, underscores), and add it to `taken`.

    A number is appended to an identifier that is already in `taken`.
    """
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    plain = plain if plain[:1].isalpha() else f"_{plain}"
    each = plain
    for number in range(2, len(taken) + 3):
        if each not in taken:
            break
        each = f"{plain}_{number}"
    taken.add(each)
    return each


def _write_clip(mesh: Any, clip: Clip, number: int, frame_count: int) -> None:
    from pxr import Gf, Sdf, UsdGeom, Vt

    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(clip.triangles), 3, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(clip.triangles.astype(np.int32).ravel()))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    points, normals, extent = mesh.CreatePointsAttr(), mesh.CreateNormalsAttr(), mesh.CreateExtentAttr()
    for index, (place, normal) in enumerate(zip(clip.positions, clip.normals, strict=True)):
        frame = clip.first + index
        points.Set(Vt.Vec3fArray.FromNumpy(place), frame)
        normals.Set(Vt.Vec3fArray.FromNumpy(normal), frame)
        extent.Set(Vt.Vec3fArray.FromNumpy(np.stack([place.min(0), place.max(0)])), frame)
    if clip.uv is not None:
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        primvar.Set(Vt.Vec2fArray.FromNumpy(clip.uv.astype(np.float32)))
    color = getattr(visual_of(clip, number).material, "baseColorFactor", None)
    if color is not None:
        shares = (np.asarray(color, dtype=np.float64)[:3] / 255).tolist()
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*shares)])
    if clip.first > 0 or clip.end < frame_count:
        seen = mesh.CreateVisibilityAttr()
        if clip.first > 0:
            seen.Set(UsdGeom.Tokens.invisible, 0)
        seen.Set(UsdGeom.Tokens.inherited, clip.first)
        if clip.end < frame_count:
            seen.Set(UsdGeom.Tokens.invisible, clip.end)
