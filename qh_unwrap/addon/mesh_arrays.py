# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes to arrays, and UVs back, in bulk; writing touches nothing but the UVs it is given."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import bmesh
import bpy
import numpy as np

from ..core import UnwrapError
from ..core.cuttable import Polygons
from ..core.edge_costs import Wishes
from ..core.pieces import around_faces
from ..core.welding import find_welds
from . import bulk
from .bulk import corner_edges, corner_triangles, corner_vertices
from .options import MeshOptions
from .shown_shape import shown_vertices


class Picture(NamedTuple):
    """What counts of an image."""

    pixels: int  # width times height
    tiles: frozenset[int]  # the numbers of its tiles, 1001 for one that has none


@dataclass(frozen=True)
class MeshArrays:
    vertices: np.ndarray  # (n, 3) float64, as the object shows them, but for its location
    up: np.ndarray  # (3,) the object's up axis in the same space
    corner_vertex: np.ndarray  # (c,) where vertices are welded, the first of them
    corner_edge: np.ndarray  # (c,) and so with edges
    face_start: np.ndarray  # (f,) first corner of each face
    seam: np.ndarray  # (e,) bool, of those that are welded all or none
    corner_triangles: np.ndarray  # (t, 3) corners
    uv: np.ndarray | None  # (c, 2) float64
    pinned: np.ndarray  # (c,) bool
    aspect: np.ndarray  # (f,) width by height of the image on each face
    slot: np.ndarray  # (f,) the number of each face's material among the images
    images: tuple[str, ...]  # what each of the materials shows, the same for what shares its UVs
    pictures: tuple["Picture | None", ...]  # the image itself of each material, None for those without one
    welded_edge: np.ndarray | None = None  # (e,) the edge that each counts as, None if nothing shall be welded
    importance: np.ndarray | None = None  # (n,) its logarithm at the vertices, None if all are alike
    wishes: Wishes | None = None  # where seams are welcome, if somebody asks

    @cached_property
    def one_aspect(self):
        """That of all faces, None if they differ."""
        return self.aspect[0] if len(self.aspect) and (self.aspect == self.aspect[0]).all() else None

    @cached_property
    def corner_faces(self):
        """(c,) the face of each corner."""
        return np.repeat(np.arange(len(self.face_start)), np.diff(self.face_start, append=len(self.corner_vertex)))

    @cached_property
    def has_pins(self):
        return bool(self.pinned.any())

    @cached_property
    def fresh(self):
        """(f,) bool, which faces have the UVs of a new map, where every face fills the square: they say nothing.

        One face alone may lie so on purpose; where several do, none counts.
        """
        if self.uv is None or not len(self.face_start):
            return np.zeros(len(self.face_start), dtype=bool)
        size = np.diff(self.face_start, append=len(self.corner_vertex))[self.corner_faces]
        place = np.arange(len(self.corner_vertex)) - self.face_start[self.corner_faces]
        angle = 2 * np.pi * place / size
        square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])[place % 4]
        expected = np.where(size[:, None] <= 4, square, 0.5 + 0.5 * np.column_stack([np.sin(angle), np.cos(angle)]))
        alike = (np.abs(self.uv - expected) < 1e-6).all(axis=1)
        found = np.logical_and.reduceat(alike, self.face_start)
        return found & (found.sum() > 1)

    def polygons(self, selected):
        """The mesh as the search for seams wants it, with the `selected` faces (f,) bool."""
        its = self.corner_vertex, self.corner_edge, self.face_start, self.corner_triangles
        return Polygons(self.vertices, *its, self.seam, selected)

    def image_of(self, faces):
        """The image that most of the faces show."""
        return self.images[0] if len(set(self.images)) == 1 else self.images[self.slot_of(faces)]

    def slot_of(self, faces):
        """The number of the material that most of the faces have."""
        if len(self.images) == 1:
            return 0
        slots, counts = np.unique(self.slot[faces], return_counts=True)
        return slots[np.argmax(counts)]

    def faces_by_image(self):
        """Yield each image, and which faces show it, (f,) bool."""
        for image in sorted(set(self.images)):
            yield image, np.array([each == image for each in self.images])[self.slot]


def read(obj, options=None, vertex_group=None):
    """The object's mesh as arrays, in any mode; does not change it.

    With the name of a `vertex_group`, which it may lack, also where seams are welcome.
    """
    options = options or MeshOptions()
    layer = _active_map(obj.data)
    name = layer.name if layer else None
    if obj.mode != 'EDIT':
        return _read(obj, obj.data, name, options, vertex_group)
    copy = bpy.data.meshes.new(obj.data.name)
    try:
        bmesh.from_edit_mesh(obj.data).to_mesh(copy)
        return _read(obj, copy, name, options, vertex_group)
    finally:
        bpy.data.meshes.remove(copy)


def is_as_read(obj, arrays):
    """Whether the object is still there with the mesh that was read: another window may have been used meanwhile."""
    try:
        mesh = obj.data if obj.mode != 'EDIT' else bmesh.from_edit_mesh(obj.data)
    except ReferenceError:
        return False
    now = (mesh.verts, mesh.edges, mesh.faces) if obj.mode == 'EDIT' else (mesh.vertices, mesh.edges, mesh.polygons)
    return [len(each) for each in now] == [len(arrays.vertices), len(arrays.seam), len(arrays.face_start)]


def _read(obj, mesh, uv_name, options, vertex_group):
    vertices = shown_vertices(obj, mesh, options.use_subsurf_data)
    shown = np.array(obj.matrix_world.to_3x3()) if options.correct_scale else np.eye(3)
    uv, pinned = None, np.zeros(len(mesh.loops), dtype=bool)
    if uv_name is not None:
        uv = uvs(mesh, uv_name).astype(np.float64)
        pins = mesh.attributes.get(f".pn.{uv_name}")  # in Blender 4, asking the layer for its pins would make this
        if pins is not None:
            pinned = bulk.values(pins.data, "value", bool)
    slot, images, aspects, pictures = _images(obj, mesh)
    corner_vertex = corner_vertices(mesh)
    corner_edge = corner_edges(mesh)
    face_start = bulk.values(mesh.polygons, "loop_start", np.int32)
    seam, welded_edge = bulk.values(mesh.edges, "use_seam", bool), None
    if options.weld:
        unsmoothed = shown_vertices(obj, mesh, False) if options.use_subsurf_data else vertices
        welds = find_welds(_shapes(obj, unsmoothed), corner_vertex, corner_edge, face_start, len(seam))
        corner_vertex, corner_edge, welded_edge = welds.vertex[corner_vertex], welds.edge[corner_edge], welds.edge
        seam = (np.bincount(welded_edge, seam, len(seam)) > 0)[welded_edge]
    importance = _importance(obj, mesh, options)
    return MeshArrays(
        vertices=vertices.astype(np.float64) @ shown.T,
        up=shown[:, 2] / (np.linalg.norm(shown[:, 2]) or 1.0),
        corner_vertex=corner_vertex,
        corner_edge=corner_edge,
        face_start=face_start,
        seam=seam,
        corner_triangles=corner_triangles(mesh),
        uv=uv,
        pinned=pinned,
        aspect=aspects[slot] if options.correct_aspect else np.ones(len(mesh.polygons)),
        slot=slot,
        images=images,
        pictures=pictures,
        welded_edge=welded_edge,
        importance=importance,
        wishes=None if vertex_group is None else _wishes(obj, mesh, vertex_group, corner_edge, face_start, importance),
    )


def _wishes(obj, mesh, vertex_group, corner_edge, face_start, importance):
    """Sharp edges and borders of materials are marked, the vertices of the group are spared by their weights, and seams
    keep away from what is important."""
    marked = bulk.values(mesh.edges, "use_edge_sharp", bool)
    material = bulk.values(mesh.polygons, "material_index", np.int32)[around_faces(face_start, len(corner_edge))[0]]
    lowest, highest = np.full(len(marked), np.iinfo(np.int32).max), np.full(len(marked), -1)
    np.minimum.at(lowest, corner_edge, material)
    np.maximum.at(highest, corner_edge, material)
    important = None if importance is None else np.exp(importance)
    return Wishes(marked | (lowest < highest), _weights(obj, mesh, vertex_group), importance=important)


def _importance(obj, mesh, options):
    """The logarithms of the importance of the vertices, None if nobody asks or there is no such group."""
    weights = _weights(obj, mesh, options.weight_group) if options.use_weights else None
    return None if weights is None else weights * np.log(options.weight_factor)


def _weights(obj, mesh, name):
    """The weights (n,) of the vertices in the group, None if there is no such group."""
    group = obj.vertex_groups.get(name)
    if group is None:
        return None
    weights = np.zeros(len(mesh.vertices))
    for k, vertex in enumerate(mesh.vertices):
        for each in vertex.groups:
            if each.group == group.index:
                weights[k] = each.weight
    return weights


def uvs(mesh, name):
    """(c, 2) float32 the UVs of the map with this name."""
    return bulk.values(mesh.uv_layers[name].uv, "vector", np.float32, 2)


def _shapes(obj, shown):
    """Yield every shape that the mesh can take, (n, 3) each: that of each of its keys, and their mix that is shown.

    The mix may part what every key has at one place, since a vertex group can let a key act on some vertices only.  In
    Edit Mode the keys are up to date once the mix is known.
    """
    keys = obj.data.shape_keys
    for key in keys.key_blocks if keys else ():
        yield bulk.values(key.data, "co", np.float32, 3)
    yield shown


def materials_on(obj, mesh):
    """The object's materials, [None] for none, and the number of each face's among them, (f,)."""
    materials = [slot.material for slot in obj.material_slots] or [None]
    if len(materials) == 1:
        return materials, np.zeros(len(mesh.polygons), dtype=np.int32)
    return materials, np.minimum(bulk.values(mesh.polygons, "material_index", np.int32), len(materials) - 1)


def _images(obj, mesh):
    """The number of each face's material, (f,), what these materials show, the aspects of that, (m,), and their
    images.

    What has the same image shares its UVs; without an image, what has the same material, which may get one later; and
    without a material, what is one object.
    """
    materials, slot = materials_on(obj, mesh)
    images = [image_of(material) for material in materials]
    names = tuple(
        f"image {image.name_full}"
        if image
        else f"material {material.name_full}"
        if material
        else f"object {obj.name_full}"
        for image, material in zip(images, materials, strict=True)
    )
    aspects = np.array([aspect_of(image) for image in images])
    return slot, names, aspects, tuple(_picture(image) for image in images)


def image_of(material):
    """The image that Blender shows for the material in the viewport, None if there is none."""
    nodes = material.node_tree.nodes if material and material.use_nodes and material.node_tree else ()
    nodes = [node for node in nodes if node.type == 'TEX_IMAGE' and node.image and min(node.image.size) > 0]
    return next((node for node in nodes if node.show_texture), nodes[0]).image if nodes else None


def _picture(image):
    if image is None:
        return None
    tiles = [tile.number for tile in image.tiles] if image.source == 'TILED' else [1001]
    return Picture(image.size[0] * image.size[1], frozenset(tiles))


def aspect_of(image):
    """Width by height of the image as it is shown, 1 for none."""
    if image is None:
        return 1.0
    (width, height), (pixel_width, pixel_height) = image.size, image.display_aspect
    return (width * pixel_width) / (height * pixel_height)


def write(obj, corners, uv):
    """Give the corners their UVs, in a new map "UVMap" if there is none.  Call it within `modes.in_object_mode`."""
    mesh = obj.data
    layer = _active_or_new_map(mesh)
    if layer is None:
        raise UnwrapError("Blender could not add a UV map: remove one of the mesh's UV maps or attributes")
    values = bulk.values(layer.uv, "vector", np.float32, 2)
    values[corners] = uv
    if bpy.app.version >= (5, 0, 0):  # where `mesh.attributes` would spoil the selection of UVs
        layer.uv.foreach_set("vector", values.ravel())
    else:  # where `layer.uv` would write into arrays that undo steps and copies of the mesh share
        layer.data.foreach_set("uv", values.ravel())
    mesh.update()


def edge_vertices(obj):
    """(e, 2) the vertices of the object's edges; not in Edit Mode."""
    return bulk.values(obj.data.edges, "vertices", np.int32, 2)


def mark_seams(obj, edges):
    """Mark the edges (e,) bool as seams; call it within `modes.in_object_mode`."""
    seam = bulk.values(obj.data.edges, "use_seam", bool)
    obj.data.edges.foreach_set("use_seam", seam | edges)
    obj.data.update()


def _active_map(mesh):
    """The map that Blender works on, None if there is none: where none is active, as Blender 5 allows, the first."""
    return mesh.uv_layers.active or (mesh.uv_layers[0] if len(mesh.uv_layers) else None)


def _active_or_new_map(mesh):
    return _active_map(mesh) or mesh.uv_layers.new(name="UVMap")
