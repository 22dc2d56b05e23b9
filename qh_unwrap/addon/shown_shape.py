# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an object shows its vertices: with its shape keys and, if wanted, its Subdivision Surface modifier."""

import bpy

from .bulk import coordinates

_NAME = "QH Unwrap"


def shown_vertices(obj, mesh, use_subsurf):
    """The object's vertices, (n, 3) float32, without its location, rotation and scale.

    obj          in any mode
    mesh         what it is made of, in Edit Mode a copy of what is edited
    use_subsurf  whether they are where its Subdivision Surface modifier, on its own, takes them

    In Edit Mode as in Object Mode it is the mix of the shape keys that counts, as Object Mode shows it, and not the key
    that happens to be active; so the result does not depend on the mode.
    """
    modifier = next((one for one in obj.modifiers if one.type == 'SUBSURF' and one.show_viewport), None)
    modifier = modifier if use_subsurf else None
    if not obj.data.shape_keys:
        return coordinates(mesh) if modifier is None else _evaluated(obj, mesh.copy(), modifier)
    if obj.mode == 'EDIT':
        obj.update_from_editmode()  # the keys, too
    return _evaluated(obj, obj.data.copy(), modifier)


def _evaluated(obj, mesh, modifier):
    """The vertices of `mesh`, which is the caller's no more, as Blender would show them on the object."""
    scene = bpy.data.scenes.new(_NAME)
    count = len(mesh.vertices)
    try:
        twin = bpy.data.objects.new(_NAME, mesh)
        if mesh.shape_keys:
            mesh.shape_keys.animation_data_clear()  # the values are those of the current frame
            twin.active_shape_key_index = obj.active_shape_key_index
            twin.show_only_shape_key = obj.show_only_shape_key
        scene.collection.objects.link(twin)
        if modifier is not None:
            alone = twin.modifiers.new(modifier.name, 'SUBSURF')
            for setting in alone.bl_rna.properties:
                if not setting.is_readonly:
                    setattr(alone, setting.identifier, getattr(modifier, setting.identifier))
        view_layer = scene.view_layers[0]
        view_layer.update()
        return coordinates(twin.evaluated_get(view_layer.depsgraph).data)[:count]  # a modifier's new ones come last
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.meshes.remove(mesh)
