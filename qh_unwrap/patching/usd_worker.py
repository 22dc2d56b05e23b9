# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done with USD's library, as a program: `python usd_worker.py FOLDER`, where the folder has the task.

It imports nothing of the package, so that it runs from wherever it is.
"""

import json
import sys
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt

_UV_TYPES = {
    str(kind)
    for kind in (
        Sdf.ValueTypeNames.TexCoord2fArray,
        Sdf.ValueTypeNames.TexCoord2dArray,
        Sdf.ValueTypeNames.TexCoord2hArray,
    )
} | {str(Sdf.ValueTypeNames.Float2Array)}


def main():
    folder = Path(sys.argv[1])
    task = json.loads((folder / "task.json").read_text(encoding="utf-8"))
    arrays = {}
    try:
        if task["task"] == "read":
            answer, arrays = _read(task["path"])
        else:
            with np.load(folder / "task.npz") as given:
                answer = _write(task, dict(given))
    except Tf.ErrorException as error:
        answer = dict(error=str(error).strip().splitlines()[-1])
    np.savez(folder / "answer.npz", **arrays)
    (folder / "answer.json").write_text(json.dumps(answer), encoding="utf-8")


def _read(path):
    stage = Usd.Stage.Open(path)
    to_meters = UsdGeom.GetStageMetersPerUnit(stage)
    is_y_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    meshes, arrays = [], {}
    transforms = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh, number = UsdGeom.Mesh(prim), len(meshes)
        sizes, vertices, points = (
            _value(each)
            for each in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetPointsAttr())
        )
        sizes, vertices = (np.array(each or (), dtype=np.int64) for each in (sizes, vertices))
        points = np.array(points or (), dtype=np.float32).reshape(-1, 3)
        refusal = ""
        if sizes.sum() != len(vertices) or (len(vertices) and not 0 <= vertices.min() <= vertices.max() < len(points)):
            refusal, sizes, vertices = f"the faces of {prim.GetPath()} are not whole", sizes[:0], vertices[:0]
        if prim.IsInstanceProxy():
            refusal = f"{prim.GetPath()} is within an instance"
        maps = []
        for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithValues():
            if str(primvar.GetTypeName()) not in _UV_TYPES:
                continue
            values = _at_corners(primvar, vertices, sizes)
            if values is not None:
                arrays[f"{number}.uv.{len(maps)}"] = values
                maps.append(
                    dict(
                        name=primvar.GetPrimvarName(),
                        is_animated=primvar.ValueMightBeTimeVarying(),
                        is_half=primvar.GetTypeName() == Sdf.ValueTypeNames.TexCoord2hArray,
                    )
                )
        is_left_handed = mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded
        first = points[vertices[sizes[0] - 1 if is_left_handed else 0]] if len(vertices) else np.zeros(3)
        arrays |= {
            f"{number}.sizes": sizes,
            f"{number}.vertices": vertices,
            f"{number}.points": points,
            f"{number}.places": _places(transforms, prim, first, is_y_up, to_meters),
        }
        meshes.append(
            dict(
                name=prim.GetName(),
                path=str(prim.GetPath()),
                refusal=refusal,
                is_left_handed=is_left_handed,
                maps=maps,
            )
        )
    return dict(meshes=meshes), arrays


def _value(attribute):
    """Its value, that of the first time if it has no other."""
    value = attribute.Get()
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value


def _at_corners(primvar, vertices, sizes):
    """(c, 2) its values at the corners, None if they are of another number."""
    values = primvar.ComputeFlattened()
    if values is None:
        values = primvar.ComputeFlattened(Usd.TimeCode.EarliestTime())
    values = np.array(values or (), dtype=np.float64).reshape(-1, 2)
    where = {
        "faceVarying": np.arange(len(vertices)),
        "vertex": vertices,
        "varying": vertices,
        "uniform": np.repeat(np.arange(len(sizes)), sizes),
        "constant": np.zeros(len(vertices), dtype=np.int64),
    }[primvar.GetInterpolation()]
    return values[where] if len(where) and where.max() < len(values) else None


def _places(transforms, prim, first, is_y_up, to_meters):
    """(2, 3) where Blender shows the first corner, in units of the file and in meters: its versions differ in that."""
    x, y, z = transforms.GetLocalToWorldTransform(prim).Transform(Gf.Vec3d(*map(float, first)))
    place = np.array((x, -z, y) if is_y_up else (x, y, z))
    return np.array([place, to_meters * place])


def _write(task, arrays):
    original = Sdf.Layer.FindOrOpen(task["path"])
    if task["in_place"]:
        layer = original
    else:
        layer = Sdf.Layer.CreateAnonymous(".usda")
        for key in original.pseudoRoot.ListInfoKeys():
            if key not in ("subLayers", "subLayerOffsets", "layerRelocates"):  # which go on to count in their own layer
                layer.pseudoRoot.SetInfo(key, original.pseudoRoot.GetInfo(key))
        layer.subLayerPaths.append(task["path"])
    stage = Usd.Stage.Open(layer)
    for number, change in enumerate(task["changes"]):
        _over(
            stage.GetPrimAtPath(change["path"]), change["name"], arrays[f"{number}.values"], arrays[f"{number}.index"]
        )
    if not task["in_place"]:
        layer.subLayerPaths[:] = [task["original"]]
    is_text = Path(task["path"]).read_bytes()[:5] == b"#usda"
    kind = {"format": "usda" if is_text else "usdc"} if task["output"].endswith(".usd") else {}
    if not layer.Export(task["output"], args=kind):
        return dict(error="USD's library could not write it")
    return {}


def _over(prim, name, values, index):
    if not Sdf.Path.IsValidNamespacedIdentifier(name):
        name = Tf.MakeValidIdentifier(name)
    api = UsdGeom.PrimvarsAPI(prim)
    old = api.GetPrimvar(name)
    kind = old.GetTypeName() if old and old.HasValue() else Sdf.ValueTypeNames.TexCoord2fArray
    primvar = api.CreatePrimvar(name, kind, UsdGeom.Tokens.faceVarying)
    for attribute in (primvar.GetAttr(), primvar.GetIndicesAttr()):
        if attribute and attribute.GetNumTimeSamples() == 1:
            attribute.Clear()
    is_double = kind == Sdf.ValueTypeNames.TexCoord2dArray
    array = Vt.Vec2dArray if is_double else Vt.Vec2fArray
    primvar.Set(array.FromNumpy(np.ascontiguousarray(values, dtype=np.float64 if is_double else np.float32)))
    primvar.SetIndices(Vt.IntArray.FromNumpy(index.astype(np.int32)))


if __name__ == "__main__":
    main()
