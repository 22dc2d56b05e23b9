# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the unwrapped model beside its UV layout, both with the same checker, each island in its colour."""

import colorsys

import bpy
import numpy as np
from mathutils import Matrix

from ..core.islands import find_islands
from . import mesh_arrays

_WIDTH, _HEIGHT = 1200, 600
_PIXEL = 2 / _WIDTH  # the picture shows two unit squares side by side
_ROOM = 0.88  # of its square that the model or the layout fills
_VIEW = Matrix.Rotation(np.radians(8), 4, 'X') @ Matrix.Rotation(np.radians(-28), 4, 'Z')
_CELLS = 26  # checker cells along the model's longest side
_BACKGROUND = (0.86, 0.86, 0.86, 1.0)
_GREY = (0.6, 0.6, 0.6)


FORMATS = {".png": 'PNG', ".jpg": 'JPEG', ".jpeg": 'JPEG'}


def render(targets, outcomes, options, path):
    """Write a picture of what was unwrapped with these options to a new file; nothing else of it stays in Blender."""
    before = {kind: set(getattr(bpy.data, kind)) for kind in _KINDS}
    try:
        scene = _scene(targets, outcomes, options)
        settings = scene.render.image_settings
        settings.file_format = FORMATS[path.suffix.lower()]
        settings.color_mode, settings.quality = 'RGB', 90
        scene.render.use_file_extension = False
        scene.render.filepath = _as_template(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        for kind, present in before.items():
            bpy.data.batch_remove(set(getattr(bpy.data, kind)) - present)


def _as_template(path):
    """The path as Blender wants it for pictures: from version 4.5 on, braces have a meaning there."""
    return str(path).replace("{", "{{").replace("}", "}}") if bpy.app.version >= (4, 5, 0) else str(path)


_KINDS = (
    "scenes",
    "objects",
    "meshes",
    "materials",
    "node_groups",
    "cameras",
    "lights",
    "worlds",
    "collections",
    "images",
)


def _scene(targets, outcomes, options):
    scene = bpy.data.scenes.new("QH Unwrap Preview")
    failed = {(outcome.obj, outcome.number) for outcome in outcomes if outcome.error}
    objects = [target.obj for target in targets]
    meshes = [mesh_arrays.read(obj, options) for obj in objects]
    sheets = []  # (object, mesh, island) of every island with new UVs, the largest first
    for (obj, faces, _), mesh in zip(targets, meshes, strict=True):
        islands = find_islands(
            mesh.corner_vertex,
            mesh.corner_edge,
            mesh.face_start,
            mesh.seam,
            faces,
            mesh.corner_triangles,
        )
        sheets += [
            (obj, mesh, island) for number, island in enumerate(islands, start=1) if (obj.name, number) not in failed
        ]
    sheets.sort(key=lambda sheet: -len(sheet[2].faces))
    tints = {
        obj: np.tile((*_GREY, 1.0), (len(mesh.corner_vertex), 1)) for obj, mesh in zip(objects, meshes, strict=True)
    }
    for number, (obj, _, island) in enumerate(sheets):
        tints[obj][island.corners] = _tint(number)
    cells = _cells(objects, sheets)
    _add_models(scene, tints, _checker("Model", cells, lit=True))
    _add_sheets(scene, sheets, cells)
    _add_camera_and_light(scene)
    return scene


def _add_models(scene, tints, material):
    points = np.vstack([_world_points(obj) for obj in tints]) @ np.array(_VIEW.to_3x3()).T
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    scale = _ROOM / max(size[0], size[2])
    middle = low + size / 2
    place = Matrix.Translation((-0.5, 0, 0)) @ Matrix.Scale(scale, 4) @ Matrix.Translation(-middle) @ _VIEW
    for obj, tint in tints.items():
        mesh = obj.data.copy()
        mesh.materials.clear()
        mesh.materials.append(material)
        layer = mesh.color_attributes.new("QH Unwrap", 'FLOAT_COLOR', 'CORNER')
        layer.data.foreach_set("color", tint.astype(np.float32).ravel())
        if mesh.uv_layers.active:
            mesh.uv_layers.active.active_render = True  # what was unwrapped is what is shown
        copy = bpy.data.objects.new(obj.name, mesh)
        copy.matrix_world = place @ obj.matrix_world
        scene.collection.objects.link(copy)


def _add_sheets(scene, sheets, cells):
    """The layout, upright, facing the camera: islands as they are, their edges and outlines as ribbons before them."""
    uvs = [_island_uv(island, mesh) for _, mesh, island in sheets]
    low = np.min([uv.min(axis=0) for uv in uvs] + [(0, 0)], axis=0)
    high = np.max([uv.max(axis=0) for uv in uvs] + [(1, 1)], axis=0)
    size = (high - low).max()

    def place(uv, depth):
        x, z = ((uv - (low + high) / 2) * (_ROOM / size)).T
        return np.column_stack([x + 0.5, np.full(len(uv), -1 - depth), z])

    material = _checker("Layout", cells, lit=False)
    ribbons, outlines = [], []
    for number, ((_, mesh, island), uv) in enumerate(zip(sheets, uvs, strict=True)):
        corners = island.triangles.ravel()
        _add_mesh(
            scene, place(uv, 0), island.triangles, material, uv[corners], np.tile(_tint(number), (len(corners), 1))
        )
        edges, is_outline = _edges(island, mesh)
        ends = place(uv, 0)[:, ::2][edges]
        ribbons.append(ends[~is_outline])
        outlines.append(ends[is_outline])
    corner_points = place(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]), 0)[:, ::2]
    frame = np.stack([corner_points, np.roll(corner_points, -1, axis=0)], axis=1)
    _add_ribbons(scene, frame, -0.1, 1.2, (0.45, 0.45, 0.45))
    ribbons, outlines = np.concatenate(ribbons), np.concatenate(outlines)
    if len(ribbons) and np.median(np.linalg.norm(ribbons[:, 1] - ribbons[:, 0], axis=1)) > 4 * _PIXEL:
        _add_ribbons(scene, ribbons, 0.1, 0.7, (0.10, 0.10, 0.12))
    _add_ribbons(scene, outlines, 0.2, 2.0, (0.02, 0.02, 0.03))


def _island_uv(island, mesh):
    uv = np.empty((len(island.vertices), 2))
    uv[island.corner_vertex] = mesh.uv[island.corners]
    return uv


def _edges(island, mesh):
    """The faces' edges (e, 2) as island vertices, and which of them are the island's outline."""
    corners, vertex = island.corners[: island.own_corners], island.corner_vertex[: island.own_corners]
    starts = np.isin(corners, mesh.face_start)
    first = np.flatnonzero(starts)
    following = np.arange(1, len(starts) + 1)
    following[np.append(first[1:], len(starts)) - 1] = first
    ends = np.sort(np.column_stack([vertex, vertex[following]]), axis=1)
    edges, uses = np.unique(ends, axis=0, return_counts=True)
    return edges, uses == 1


def _add_ribbons(scene, ends, depth, pixels, colour):
    """Line segments (s, 2, 2) in the picture's plane, some pixels wide."""
    half = pixels * _PIXEL / 2
    along = ends[:, 1] - ends[:, 0]
    along *= half / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    across = along[:, ::-1] * (-1, 1)
    a, b = ends[:, 0] - along, ends[:, 1] + along
    flat = np.stack([a - across, b - across, b + across, a + across], axis=1).reshape(-1, 2)
    points = np.column_stack([flat[:, 0], np.full(len(flat), -1 - depth), flat[:, 1]])
    _add_mesh(scene, points, np.arange(len(points)).reshape(-1, 4), _flat("Line", colour))


def _add_mesh(scene, points, faces, material, uv=None, tints=None):
    mesh = bpy.data.meshes.new("QH Unwrap")
    mesh.from_pydata(points, [], faces)
    mesh.materials.append(material)
    if uv is not None:
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uv.astype(np.float32).ravel())
        layer = mesh.color_attributes.new("QH Unwrap", 'FLOAT_COLOR', 'CORNER')
        layer.data.foreach_set("color", tints.astype(np.float32).ravel())
    scene.collection.objects.link(bpy.data.objects.new("QH Unwrap", mesh))


def _add_camera_and_light(scene):
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type = 'ORTHO'
    camera.data.ortho_scale = 2
    camera.matrix_world = Matrix.Translation((0, -10, 0)) @ Matrix.Rotation(np.pi / 2, 4, 'X')
    scene.collection.objects.link(camera)
    scene.camera = camera
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", 'SUN'))
    sun.data.energy = 2.3
    sun.data.angle = 0.2
    sun.rotation_euler = np.radians((50, 0, -35))
    scene.collection.objects.link(sun)

    scene.world = bpy.data.worlds.new("QH Unwrap")
    _use_nodes(scene.world)
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = _BACKGROUND
    with bpy.context.temp_override(scene=scene):  # Cycles looks at the context's world when this changes
        scene.world.cycles_visibility.diffuse = False  # the materials glow instead, without noise
    scene.view_settings.view_transform = 'Standard'
    scene.render.engine = 'CYCLES'
    scene.cycles.device = 'CPU'
    scene.cycles.samples = 12
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.render.resolution_x, scene.render.resolution_y = _WIDTH, _HEIGHT
    scene.render.resolution_percentage = 100


def _checker(name, cells, *, lit):
    """White and grey cells, dyed with the island's colour."""
    material, tree, output = _material(name)
    uv = tree.nodes.new("ShaderNodeUVMap")
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = cells
    checker.inputs["Color1"].default_value = (1, 1, 1, 1)
    checker.inputs["Color2"].default_value = (0.42, 0.42, 0.42, 1)
    tint = tree.nodes.new("ShaderNodeVertexColor")
    tint.layer_name = "QH Unwrap"
    dyed = tree.nodes.new("ShaderNodeMixRGB")
    dyed.blend_type = 'MULTIPLY'
    dyed.inputs["Fac"].default_value = 1
    glow = tree.nodes.new("ShaderNodeEmission")
    glow.inputs["Strength"].default_value = 0.4 if lit else 1
    both = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(uv.outputs["UV"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], dyed.inputs["Color1"])
    tree.links.new(tint.outputs["Color"], dyed.inputs["Color2"])
    tree.links.new(dyed.outputs["Color"], glow.inputs["Color"])
    tree.links.new(glow.outputs[0], both.inputs[0])
    if lit:
        diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(dyed.outputs["Color"], diffuse.inputs["Color"])
        tree.links.new(diffuse.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], output.inputs["Surface"])
    return material


def _flat(name, colour):
    material, tree, output = _material(name)
    shader = tree.nodes.new("ShaderNodeEmission")
    shader.inputs["Color"].default_value = (*colour, 1)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def _material(name):
    material = bpy.data.materials.new(name)
    _use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def _use_nodes(owner):
    if bpy.app.version < (5, 0, 0):  # later there is nothing else
        owner.use_nodes = True


def _tint(number):
    """Light colours, neighbours in number far apart in hue; linear RGB and alpha."""
    hue = (0.57 + number * 0.618034) % 1
    return *(value**2.2 for value in colorsys.hsv_to_rgb(hue, 0.28, 0.96)), 1.0


def _cells(objects, sheets):
    """Checker cells along the unit square, so that about `_CELLS` of them lie along the longest side of the model."""
    length = max(np.ptp(np.vstack([_world_points(obj) for obj in objects]), axis=0))
    surface = sum(_area(mesh.vertices[island.vertices], island.triangles) for _, mesh, island in sheets)
    flat = sum(_area(_island_uv(island, mesh), island.triangles) for _, mesh, island in sheets)
    return float(np.clip(round(_CELLS / length * np.sqrt(surface / max(flat, 1e-12))), 1, 1000))


def _area(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    one, other = b - a, c - a
    squares = (one * one).sum(axis=1) * (other * other).sum(axis=1) - (one * other).sum(axis=1) ** 2
    return np.sqrt(np.maximum(squares, 0)).sum() / 2


def _world_points(obj):
    points = np.empty(len(obj.data.vertices) * 3, dtype=np.float32)
    obj.data.vertices.foreach_get("co", points)
    world = np.array(obj.matrix_world)
    return points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
