# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's importers and exporters, with the options with which they lose the least."""

from contextlib import nullcontext

import bpy
import numpy as np

from . import curves, takes
from .origin import Origin

_RATES = (24, 25, 30, 50, 60, 48, 90, 100, 120, 240)  # frames per second, of which the first that fits is taken
_GLTF = (".glb", ".gltf")
_USD = (".usd", ".usda", ".usdc")


class _Open:
    origin = Origin()


def prepare(suffix, origin):
    """Say where the open file comes from, and in which format it will be written."""
    _Open.origin = origin
    if origin.suffix in _USD and suffix not in _USD:
        for obj in bpy.data.objects:
            for modifier in [each for each in obj.modifiers if each.type == 'SUBSURF']:
                obj.modifiers.remove(modifier)  # which exporters would apply, or which stand for nothing there


def new_scene():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True, load_ui=False)


def _run(operator, filepath, **options):
    """Call the operator with those of the options that this version of Blender has."""
    known = operator.get_rna_type().properties.keys()
    return operator(filepath=filepath, **{name: value for name, value in options.items() if name in known})


def _read_blend(filepath):
    # Without the user interface, the view layer and the modes of objects would be others, and workspaces be missing.
    return bpy.ops.wm.open_mainfile(filepath=filepath, load_ui=True, use_scripts=False)


def _importer(operator, **options):
    def read(filepath):
        new_scene()
        return _run(operator, filepath, **options)

    return read


def _import_gltf(filepath, rate=None):
    new_scene()
    if rate:
        bpy.context.scene.render.fps = rate
    return _run(
        bpy.ops.import_scene.gltf,
        filepath,
        disable_bone_shape=True,  # which would be a mesh that the file does not have
    )


def _read_gltf(filepath):
    """Import it at a frame rate at which its keyframes are at whole frames, if there is one: files have none."""
    result = _import_gltf(filepath)
    frames = curves.frames()
    rate = next((rate for rate in _RATES if _are_whole(frames * rate / _RATES[0])), _RATES[0])
    if rate != _RATES[0]:
        result = _import_gltf(filepath, rate)
    _join_split_nodes()
    return result


def _join_split_nodes():
    """Have one object for a node with a skinned mesh of which shape keys are animated: the importer makes two of it.

    The second one has the mesh, and the first is empty; each further import would leave one more.
    """
    for obj in list(bpy.data.objects):
        first = bpy.data.objects.get(obj.name.rpartition(".")[0])
        if first and _is_left_behind(first) and _is_posed(obj):
            name = first.name
            for key, value in first.items():
                obj[key] = value
            bpy.data.objects.remove(first)
            obj.name = name


def _is_left_behind(obj):
    return obj.type == 'EMPTY' and not (obj.children or obj.animation_data or obj.instance_collection)


def _is_posed(obj):
    keys = obj.data.shape_keys if obj.type == 'MESH' else None
    return obj.find_armature() and keys and keys.animation_data


def _are_whole(numbers):
    return np.allclose(numbers, np.round(numbers), rtol=0, atol=1e-3)


_read_usd = _importer(
    bpy.ops.wm.usd_import,
    import_subdiv=True,  # as modifiers, else a .usd file would not say any more what is a subdivision surface
    import_subdivision=True,  # the same from Blender 5.2 on
)

READERS = {
    ".blend": _read_blend,
    ".obj": _importer(bpy.ops.wm.obj_import, import_vertex_groups=True),  # which stand for the groups of faces
    ".ply": _importer(bpy.ops.wm.ply_import),
    ".stl": _importer(bpy.ops.wm.stl_import),
    ".glb": _read_gltf,
    ".gltf": _read_gltf,
    ".fbx": _importer(bpy.ops.import_scene.fbx),
    ".usd": _read_usd,
    ".usda": _read_usd,
    ".usdc": _read_usd,
}


def _write_blend(filepath):
    return _run(bpy.ops.wm.save_as_mainfile, filepath, copy=True, compress=_Open.origin.compressed)


def _write_obj(filepath):
    return _run(
        bpy.ops.wm.obj_export,
        filepath,
        path_mode='RELATIVE',
        export_colors=True,
        export_vertex_groups=_Open.origin.suffix == ".obj",
    )


def _write_gltf(filepath):
    is_gltf = _Open.origin.suffix in _GLTF
    return _run(
        bpy.ops.export_scene.gltf,
        filepath,
        export_format='GLB' if filepath.lower().endswith(".glb") else 'GLTF_SEPARATE',
        export_extras=True,
        export_cameras=True,
        export_lights=True,
        export_attributes=True,
        export_force_sampling=not is_gltf,  # keyframes of such a file are as it can have them
        export_all_influences=is_gltf,
        use_mesh_edges=is_gltf,
        use_mesh_vertices=is_gltf,
        export_texture_dir=_Open.origin.pictures,
    )


def _write_usd(filepath):
    origin = _Open.origin
    is_usd = origin.suffix in _USD
    return _run(
        bpy.ops.wm.usd_export,
        filepath,
        root_prim_path=f"/{origin.default_prim or 'root'}",  # holds the materials, too
        export_animation=curves.is_animated(),
        allow_unicode=True,
        rename_uvmaps=not is_usd,
        convert_orientation=is_usd and origin.y_up,
        convert_scene_units='CUSTOM',
        meters_per_unit=origin.metres if is_usd else 1.0,
        export_textures=not _is_single_usd(),  # else pictures stay where they are
        export_textures_mode='KEEP' if _is_single_usd() else 'NEW',  # the same from Blender 4.5 on
    )


def _write_fbx(filepath):
    origin = _Open.origin
    is_packed = _has_packed_images()
    is_in_metres = origin.suffix == ".fbx" and origin.metres == 1
    scenes = takes.sorted_out(origin.takes)
    with takes.arranged(scenes) if scenes else nullcontext():
        return _run(
            bpy.ops.export_scene.fbx,
            filepath,
            use_custom_props=True,
            add_leaf_bones=False,
            apply_scale_options='FBX_SCALE_UNITS' if is_in_metres else 'FBX_SCALE_NONE',
            **_axes(origin.axes),
            bake_anim_use_all_actions=not scenes,
            bake_anim_simplify_factor=0.01 if scenes else 1.0,
            path_mode='COPY' if is_packed else 'RELATIVE',
            embed_textures=is_packed,
        )


def _axes(numbers):
    """The exporter's options for the axes that stand in a .fbx file, if it knows them."""
    from io_scene_fbx.fbx_utils import RIGHT_HAND_AXES  # comes with Blender

    pairs = tuple(zip(numbers[::2], numbers[1::2], strict=True))
    names = next((names for names, known in RIGHT_HAND_AXES.items() if known == pairs), None)
    return dict(axis_up=names[0], axis_forward=names[1]) if names else {}


def _has_packed_images():
    return any(image.packed_file for image in bpy.data.images)


def _exporter(operator, **options):
    return lambda filepath: _run(operator, filepath, **options)


WRITERS = {
    ".blend": _write_blend,
    ".obj": _write_obj,
    ".ply": _exporter(bpy.ops.wm.ply_export),
    ".glb": _write_gltf,
    ".gltf": _write_gltf,
    ".fbx": _write_fbx,
    ".usd": _write_usd,
    ".usda": _write_usd,
    ".usdc": _write_usd,
}


def is_single(suffix):
    """Whether the open file, written in this format, is a single file in which paths are relative to its folder."""
    return suffix in (".blend", ".fbx") or (suffix in _USD and _is_single_usd())


def _is_single_usd():
    """Whether no pictures are written beside it: those that are no files yet, and one for the color of the world."""
    return not (_has_packed_images() or bpy.context.scene.world)
