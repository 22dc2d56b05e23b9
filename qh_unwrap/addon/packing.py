# SPDX-License-Identifier: GPL-3.0-or-later
"""Laying islands out beside one another, by Blender's own packer."""

import bpy
import numpy as np

from ..core import UnwrapError, placing
from ..core.pieces import joined, starts_of

_NAME = "QH Unwrap"


def pack(groups, options, nested, context):
    """Lay islands out in the 0 to 1 square; returns their new UVs, one after another.

    groups  {aspect: [(uv, triangles), ...]}, by the aspect of the image; UVs have its proportions and the same scale

    If `nested`, they fit into one another, which may take Blender a minute, and are turned by right angles if the
    options say so; else their boxes lie side by side.  Blender packs what is selected in Edit Mode, so this happens in
    a scene of its own, where no one's selection is disturbed.  Raises `UnwrapError` if Blender does not.
    """
    return (_pack if nested else _pack_boxes)(groups, options, nested, context)


def _pack_boxes(groups, options, nested, context):
    """The same for their boxes, which lie side by side: of each island Blender gets a rectangle."""
    uvs = [uv for group in groups.values() for uv, _ in group]
    low, high = placing.boxes(uvs)
    high = np.maximum(high, low + 1e-6 * (high - low).max())
    corners = np.stack([low, np.column_stack([high[:, 0], low[:, 1]]), high, np.column_stack([low[:, 0], high[:, 1]])])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    rectangles = iter(corners.swapaxes(0, 1))
    boxes = {aspect: [(next(rectangles), halves) for _ in group] for aspect, group in groups.items()}
    packed = np.array(_pack(boxes, options, nested, context))
    scale = np.ptp(packed, axis=1).max(axis=1) / (high - low).max(axis=1)
    return [(uv - old) * size + new for uv, old, size, new in zip(uvs, low, scale, packed[:, 0], strict=True)]


def _pack(groups, options, nested, context):
    scene = bpy.data.scenes.new(_NAME)
    made = [scene]
    try:
        meshes = [_mesh(aspect, islands, made) for aspect, islands in groups.items()]
        if not _done(scene, meshes, options, nested, context):
            raise UnwrapError("Blender could not pack the islands: choose the placement Unit Square")
        return [uv for mesh, group in zip(meshes, groups.items(), strict=True) for uv in _uvs(mesh, *group)]
    finally:
        bpy.data.batch_remove(made)


def _done(scene, meshes, options, nested, context):
    view_layer = scene.view_layers[0]
    for mesh in meshes:
        obj = bpy.data.objects.new(_NAME, mesh)
        scene.collection.objects.link(obj)
        obj.select_set(True, view_layer=view_layer)
        view_layer.objects.active = obj
    if not scene.tool_settings.use_uv_select_sync:  # set in Blender 5, where setting it changes selections
        scene.tool_settings.use_uv_select_sync = True
    with context.temp_override(
        scene=scene,
        view_layer=view_layer,
        active_object=obj,
        object=obj,
        edit_object=obj,
        area=None,  # an image editor would have the islands packed into the tile where they lie
        region=None,
    ):
        forget_escape()
        bpy.ops.object.mode_set(mode='EDIT')
        bpy.ops.mesh.select_all(action='SELECT')
        done = bpy.ops.uv.pack_islands(
            udim_source='CLOSEST_UDIM',
            rotate=nested and options.rotate,
            rotate_method='CARDINAL',
            scale=True,
            merge_overlap=False,
            margin_method=options.margin_method,
            margin=options.margin,
            pin=False,
            shape_method='CONCAVE' if nested else 'AABB',
        )
        bpy.ops.object.mode_set(mode='OBJECT')
    return done == {'FINISHED'}


def forget_escape():
    """Have Blender forget an ESC that was pressed before, at which its packer silently stops."""
    bpy.ops.ptcache.bake_all(bake=False)


def _mesh(aspect, islands, made):
    """One mesh of all the islands' triangles, with an image of that aspect."""
    uv, triangles, _, _ = joined(*zip(*islands, strict=True))
    uv = uv / (aspect, 1)
    mesh = bpy.data.meshes.new(_NAME)
    made.append(mesh)
    mesh.vertices.add(len(uv))
    mesh.vertices.foreach_set("co", np.pad(uv, ((0, 0), (0, 1))).astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    layer = mesh.uv_layers.new(name="UVMap", do_init=False)
    layer.uv.foreach_set("vector", uv[triangles].astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    if aspect != 1:
        mesh.materials.append(_material(aspect, made))
    return mesh


def _material(aspect, made):
    image = bpy.data.images.new(_NAME, 1, 1)
    image.display_aspect = (aspect, 1) if aspect > 1 else (1, 1 / aspect)
    material = bpy.data.materials.new(_NAME)
    made += image, material
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = image
    return material


def _uvs(mesh, aspect, islands):
    vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", vertex)
    corners = np.empty(2 * len(mesh.loops), dtype=np.float32)
    mesh.uv_layers[0].uv.foreach_get("vector", corners)
    uv = np.empty((len(mesh.vertices), 2))
    uv[vertex] = corners.reshape(-1, 2) * (aspect, 1)
    return np.split(uv, starts_of([uv for uv, _ in islands])[1:])
