# SPDX-License-Identifier: GPL-3.0-or-later
"""What an object shows, as arrays: its mesh with modifiers, shape keys and what is being edited; changes nothing."""

from dataclasses import dataclass

import numpy as np

from . import bulk, mesh_arrays, texels


@dataclass(frozen=True)
class ShownMesh:
    """The faces of an object that can be seen, and their UVs."""

    points: np.ndarray  # (n, 3) float32, in the object's own space
    linear: np.ndarray  # (3, 3) what the object's rotation and scale make of that, in metres
    corner_vertex: np.ndarray  # (c,)
    corner_edge: np.ndarray  # (c,)
    edge_count: int
    face_start: np.ndarray  # (f,) first corner of each face
    triangles: np.ndarray  # (t, 3) corners
    visible: np.ndarray  # (f,) bool, False for faces that are hidden in Edit Mode
    uv: np.ndarray | None  # (c, 2) float32, None without a UV map
    pixels: np.ndarray  # (f,) how many the image on each face has, 0 for none
    aspect: np.ndarray  # (f,) its width by its height

    def is_like(self, other):
        """Whether there is nothing to measure anew."""
        return other is not None and all(_same(getattr(self, name), getattr(other, name)) for name in _FIELDS)


_FIELDS = (
    "points",
    "linear",
    "uv",
    "corner_vertex",
    "triangles",
    "visible",
    "pixels",
    "aspect",
    "face_start",
    "corner_edge",
)


def _same(one, other):
    return np.array_equal(one, other) if one is not None and other is not None else one is other


def read(obj, view_layer):
    """The object as the view layer shows it, in any mode.

    In Edit Mode, too, this goes by the evaluated object, which makes a mesh of what is edited that is no datablock:
    nothing in the file changes, and so nobody is told of a change.
    """
    shown = obj.evaluated_get(view_layer.depsgraph)
    metre = texels.unit(view_layer.id_data)
    try:
        return _read(obj, shown.to_mesh(), metre * np.array(obj.matrix_world.to_3x3()))
    finally:
        shown.to_mesh_clear()


def _read(obj, mesh, linear):
    visible = np.ones(len(mesh.polygons), dtype=bool)
    if obj.mode == 'EDIT':
        visible = ~bulk.values(mesh.polygons, "hide", bool)
    layer = mesh.uv_layers.active or next(iter(mesh.uv_layers), None)
    materials, slot = mesh_arrays.materials_on(obj, mesh)
    images = [mesh_arrays.image_of(material) for material in materials]
    return ShownMesh(
        points=bulk.coordinates(mesh),
        linear=linear,
        corner_vertex=bulk.corner_vertices(mesh),
        corner_edge=bulk.corner_edges(mesh),
        edge_count=len(mesh.edges),
        face_start=bulk.values(mesh.polygons, "loop_start", np.int32),
        triangles=bulk.corner_triangles(mesh),
        visible=visible,
        uv=None if layer is None else bulk.values(layer.uv, "vector", np.float32, 2),
        pixels=np.array([np.prod(image.size) if image else 0 for image in images])[slot],
        aspect=np.array([mesh_arrays.aspect_of(image) for image in images])[slot],
    )
