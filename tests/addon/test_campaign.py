# SPDX-License-Identifier: GPL-3.0-or-later
"""Random objects, selections, settings and editors: whatever happens, what is not selected stays as it was.

QH_CAMPAIGN objects are made (60 unless it is set), each from its own seed.
"""

import bpy  # isort: skip
import os
import random

import bmesh
import numpy as np
import pytest
from scenes import changes, select_uvs, snapshot, uvs

from qh_unwrap.addon import operators, selection

_COUNT = int(os.environ.get("QH_CAMPAIGN", "60"))

_PRIMITIVES = (
    lambda ops: ops.primitive_cube_add(),
    lambda ops: ops.primitive_grid_add(x_subdivisions=7, y_subdivisions=5),
    lambda ops: ops.primitive_uv_sphere_add(segments=10, ring_count=7),
    lambda ops: ops.primitive_ico_sphere_add(subdivisions=2),
    lambda ops: ops.primitive_cylinder_add(vertices=9),
    lambda ops: ops.primitive_cone_add(vertices=7),
    lambda ops: ops.primitive_torus_add(major_segments=9, minor_segments=6),
    lambda ops: ops.primitive_monkey_add(),
    lambda ops: ops.primitive_circle_add(vertices=8, fill_type='NGON'),
    lambda ops: ops.primitive_plane_add(),
)
_MODIFIERS = ('BEVEL', 'SUBSURF', 'DECIMATE', 'SOLIDIFY', 'WIREFRAME', 'TRIANGULATE', 'REMESH', 'SCREW')


def make(dice):
    """An object with one or two parts, seams, pins, hidden and inside-out faces, materials, maps and shape keys."""
    dice.choice(_PRIMITIVES)(bpy.ops.mesh)
    obj = bpy.context.object
    if dice.random() < 0.4:
        modifier = obj.modifiers.new("Modifier", dice.choice(_MODIFIERS))
        if modifier.type == 'REMESH':
            modifier.mode, modifier.octree_depth = 'BLOCKS', 3
        elif modifier.type == 'SUBSURF':
            modifier.levels = 1
        if dice.random() < 0.8:
            bpy.ops.object.modifier_apply(modifier=modifier.name)
    if dice.random() < 0.3 or not obj.data.polygons:  # a modifier can leave nothing
        dice.choice(_PRIMITIVES)(bpy.ops.mesh)
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
        bpy.ops.object.join()
    mesh = obj.data
    obj.scale = [dice.choice((1, 1, 1, 2, -1, 0.01, 30)) for _ in range(3)]
    while mesh.uv_layers and dice.random() < 0.2:
        mesh.uv_layers.remove(mesh.uv_layers[0])
    for _ in range(dice.choice((0, 0, 1, 2))):
        mesh.uv_layers.new()
    if mesh.uv_layers:
        mesh.uv_layers.active_index = dice.randrange(len(mesh.uv_layers))
    share = dice.choice((0, 0.05, 0.3, 1)) if len(mesh.polygons) < 100 else dice.choice((0, 0.05))
    for edge in mesh.edges:
        edge.use_seam = dice.random() < share
    for _ in range(dice.randrange(3)):
        mesh.materials.append(image_material(dice))
    for polygon in mesh.polygons:
        polygon.material_index = dice.randrange(max(1, len(mesh.materials)))
    if dice.random() < 0.2:
        for number in dice.sample(range(len(mesh.polygons)), len(mesh.polygons) // 4):
            mesh.polygons[number].flip()
    if dice.random() < 0.2:
        for vertex in dice.sample(list(mesh.vertices), len(mesh.vertices) // 5):
            vertex.co = mesh.vertices[0].co
    if dice.random() < 0.1:
        dice.choice(mesh.vertices).co.y = np.nan
    if dice.random() < 0.2:
        obj.shape_key_add(name="Basis")
        obj.shape_key_add(name="Key").data[0].co.z += 1
    bpy.context.view_layer.update()
    return obj


def image_material(dice):
    material = bpy.data.materials.new("Paint")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Paint", dice.choice((8, 16, 64)), 16)
    return material


def select(obj, dice):
    """Enter Edit Mode; select, hide and pin at random, in the mesh and the UV Editor."""
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_mode(type=dice.choice(('VERT', 'EDGE', 'FACE')))
    bpy.ops.mesh.select_all(action='DESELECT')
    bm = bmesh.from_edit_mesh(obj.data)
    share, hidden = dice.choice((0.1, 0.6, 1, 1)), dice.choice((0, 0, 0.2))
    for face in bm.faces:
        if dice.random() < share:
            face.select_set(True)
    for face in bm.faces:
        if dice.random() < hidden:
            face.hide_set(True)
    bm.select_flush_mode()
    bmesh.update_edit_mesh(obj.data)
    layer = bm.loops.layers.uv.active
    if layer is None:
        return
    share = dice.choice((0, 0, 0.05, 1))
    for face in bm.faces:
        for loop in face.loops:
            loop[layer].pin_uv = dice.random() < share
    bmesh.update_edit_mesh(obj.data)
    if dice.random() < 0.5:
        select_uvs(obj, {face.index for face in bm.faces if dice.random() < 0.7}, sticky=dice.random() < 0.5)


def settings(obj, dice):
    quickly_packed = ('PACK',) if len(obj.data.polygons) < 20 else ()
    return dict(
        boundary=dice.choice(('FREE', 'FREE', 'CIRCLE', 'RECTANGLE', 'OUTLINE', 'KEEP')),
        placement=dice.choice(('ORIGINAL', 'ORIGINAL', 'ORIGINAL', 'UNIT', *quickly_packed)),
        initial=dice.choice(('AUTO', 'AUTO', 'AUTO', 'CONFORMAL', 'PROJECTION')),
        iterations=dice.choice((0, 1, 6)),
        fill_holes=dice.random() < 0.5,
        correct_aspect=dice.random() < 0.5,
        correct_scale=dice.random() < 0.5,
        use_subsurf_data=dice.random() < 0.3,
        weld=dice.random() < 0.5,
    )


@pytest.mark.parametrize("seed", range(_COUNT))
def test_nothing_else_changes(seed, uv_editor):
    dice = random.Random(seed)
    obj = make(dice)
    if dice.random() < 0.8:
        select(obj, dice)
    bpy.context.scene.tool_settings.use_uv_select_sync = dice.random() < 0.5
    editor = uv_editor if dice.random() < 0.5 else {}
    had_map = bool(obj.data.uv_layers)
    before, old = snapshot(obj), uvs(obj) if had_map else None
    kinds = ("meshes", "objects", "scenes")
    data = [len(getattr(bpy.data, kind)) for kind in kinds]
    operators.last_outcomes.clear()
    with bpy.context.temp_override(**editor):
        targets = selection.targets(bpy.context)
        try:
            result = bpy.ops.uv.qh_unwrap(**settings(obj, dice))
        except RuntimeError as error:
            assert str(error).startswith("Error: ") and "Traceback" not in str(error)
            result = {'CANCELLED'}
    assert [len(getattr(bpy.data, kind)) for kind in kinds] == data
    difference = changes(before, snapshot(obj))
    if result == {'CANCELLED'}:
        assert difference == set()
        return
    done = [outcome for outcome in operators.last_outcomes if not outcome.error]
    assert done and all(outcome.error for outcome in operators.last_outcomes if outcome not in done)
    if not had_map:
        difference -= {".uv_select_vert", ".uv_select_edge", ".uv_select_face"}  # Blender 5 makes them with the map
        assert difference == {"UVMap", "active UV map"}
        assert np.isfinite(uvs(obj)).all()
        return
    assert difference <= {obj.data.uv_layers.active.name}
    (target,) = targets
    outside = ~np.repeat(target.faces, [polygon.loop_total for polygon in polygons(obj)])
    assert np.array_equal(uvs(obj)[outside], old[outside])
    assert np.isfinite(uvs(obj)).all()


def polygons(obj):
    obj.update_from_editmode()
    return obj.data.polygons
