# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene with something of all that files hold, and files of it that Blender writes with all that it can write."""

from math import cos, sin

import bpy
import numpy as np
from scenes import add_grid

_SEED = 5


def make(folder):
    """A waving skin on a rig, two objects of one mesh with odd normals, cameras, lights, two materials, a picture."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = 30, 1, 21
    scene["of the scene"] = "S"
    materials = [_material("Ziegel", _picture(folder)), _material("木材")]
    rig = _rig()
    _skin(rig, materials)
    one = add_grid(3, "Eins", location=(3, 0, 0))
    one.data.materials.append(materials[1])
    normals = [(0.3, 0.1, 0.95) if corner % 2 else (0, 0, 1) for corner in range(len(one.data.loops))]
    one.data.polygons.foreach_set("use_smooth", [True] * len(one.data.polygons))
    one.data.normals_split_custom_set(normals)
    empty = _add("Leer", None)
    empty["of an empty"] = True
    for frame, x in ((1, 6), (4, 7), (16, 9)):
        empty.location.x = x
        empty.keyframe_insert("location", frame=frame)
    empty.animation_data.action.name = "Fahrt"
    two = _add("Zwei", one.data)
    two.parent, two.location, two.rotation_euler, two.scale = empty, (6, 0, 1), (0.1, 0.2, 0.3), (1, 2, 0.5)
    camera = _add("Kamera", bpy.data.cameras.new("Kamera"))
    camera.location, camera.data.lens = (0, -5, 2), 35
    for kind in ('POINT', 'SUN', 'SPOT'):
        light = bpy.data.lights.new(kind.title(), kind)
        light.energy, light.color = 20, (1, 0.5, 0.2)
        _add(kind.title(), light).location = (1, 1, 4)
    scene.frame_set(1)
    bpy.context.view_layer.objects.active = one
    bpy.context.view_layer.update()


def _add(name, data):
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _picture(folder):
    image = bpy.data.images.new("bricks", 4, 4)
    (folder / "textures").mkdir(exist_ok=True)
    image.filepath_raw, image.file_format = str(folder / "textures" / "bricks.png"), 'PNG'
    image.save()
    return image


def _material(name, image=None):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material["of a material"] = 3.5
    if image:
        tree = material.node_tree
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return material


def _rig():
    armature = bpy.data.armatures.new("Rig")
    rig = _add("Rig", armature)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode='EDIT')
    root, tip = armature.edit_bones.new("Root"), armature.edit_bones.new("Spitze")
    root.tail, tip.head, tip.tail, tip.parent = (0, 0.5, 0), (0, 0.5, 0), (0, 1, 0.1), root
    bpy.ops.object.mode_set(mode='OBJECT')
    armature.bones["Root"]["of a bone"] = 2.0
    bone = rig.pose.bones["Spitze"]
    for frame, angle in ((1, 0), (7, 0.4), (21, -0.3)):
        bone.rotation_quaternion = cos(angle / 2), sin(angle / 2), 0, 0
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    rig.animation_data.action.name = "Winken"
    return rig


def _skin(rig, materials):
    obj = add_grid(4, "Haut")
    mesh, random = obj.data, np.random.default_rng(_SEED)
    mesh.name = "Haut"
    obj["of an object"], obj["list"], mesh["of a mesh"] = 7, [1.0, 2.0], "text"
    for material in materials:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", np.arange(16) // 8)
    mesh.polygons.foreach_set("use_smooth", [True] * 16)
    mesh.uv_layers.new(name="Lightmap")
    mesh.uv_layers.active = mesh.uv_layers[0]
    color = mesh.color_attributes.new("Farbe", 'FLOAT_COLOR', 'CORNER')
    color.data.foreach_set("color", random.random(4 * len(color.data)).round(2))
    heat = mesh.attributes.new("_HEAT", 'FLOAT', 'POINT')
    heat.data.foreach_set("value", random.random(len(heat.data)))
    obj.shape_key_add(name="Basis")
    tall, wide = obj.shape_key_add(name="Größer"), obj.shape_key_add(name="Wide")
    for point, broad in zip(tall.data, wide.data, strict=True):
        point.co.z += point.co.x
        broad.co.x *= 1.5
    for frame, value in ((1, 0.25), (13, 0.75)):
        tall.value = value
        tall.keyframe_insert("value", frame=frame)
    mesh.shape_keys.animation_data.action.name = "Wachsen"
    for name in ("Root", "Spitze"):
        obj.vertex_groups.new(name=name)
    for vertex in mesh.vertices:
        share = (vertex.co.y + 1) / 2
        obj.vertex_groups["Root"].add([vertex.index], 1 - share, 'REPLACE')
        obj.vertex_groups["Spitze"].add([vertex.index], share, 'REPLACE')
    obj.parent = rig
    obj.modifiers.new("Armature", 'ARMATURE').object = rig


def write(path):
    """Write it by Blender's own operator."""
    suffix = path.suffix
    if suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    elif suffix in (".glb", ".gltf"):
        bpy.ops.export_scene.gltf(
            filepath=str(path),
            export_format='GLB' if suffix == ".glb" else 'GLTF_SEPARATE',
            export_texture_dir="textures",
            export_extras=True,
            export_cameras=True,
            export_lights=True,
            export_attributes=True,
            export_force_sampling=False,
        )
    elif suffix == ".fbx":
        bpy.ops.export_scene.fbx(filepath=str(path), use_custom_props=True, add_leaf_bones=False, path_mode='RELATIVE')
    elif suffix == ".obj":
        bpy.ops.wm.obj_export(filepath=str(path), path_mode='RELATIVE', export_colors=True)
    else:
        keep = {"export_textures_mode": 'KEEP'} if bpy.app.version >= (4, 5, 0) else {"export_textures": False}
        bpy.ops.wm.usd_export(filepath=str(path), export_animation=True, allow_unicode=True, **keep)


_IMPORTERS = {
    ".glb": bpy.ops.import_scene.gltf,
    ".gltf": bpy.ops.import_scene.gltf,
    ".fbx": bpy.ops.import_scene.fbx,
    ".obj": bpy.ops.wm.obj_import,
    ".usda": bpy.ops.wm.usd_import,
    ".usdc": bpy.ops.wm.usd_import,
}


def read(path):
    """Open it as Blender does if nobody says how."""
    if path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=True)
    else:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        _IMPORTERS[path.suffix](filepath=str(path))
