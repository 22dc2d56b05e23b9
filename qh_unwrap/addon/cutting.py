# SPDX-License-Identifier: GPL-3.0-or-later
"""New seams for the chosen faces of objects."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from ..core import Settings
from ..core.seam_settings import SeamSettings
from ..core.seams import SeamResult, cut_open, cut_to
from ..core.stepping import mapped
from ..core.triangles import areas_in_space
from . import mesh_arrays
from .options import SeamOptions
from .outcome import count
from .selection import Target


@dataclass
class Cut:
    """The mesh of a target with the seams that it is to get."""

    target: Target
    mesh: mesh_arrays.MeshArrays  # whose seams are the old and the new ones
    new: np.ndarray  # (e,) bool, the edges that are to be marked
    result: SeamResult

    @property
    def area(self):
        """Of the target's faces, in the mesh's unit."""
        chosen = self.target.faces[self.mesh.corner_faces[self.mesh.corner_triangles[:, 0]]]
        triangles = self.mesh.corner_vertex[self.mesh.corner_triangles[chosen]]
        return float(areas_in_space(self.mesh.vertices, triangles).sum())

    def to_dict(self):
        """JSON-ready; every edge by its vertices."""
        ends = mesh_arrays.edge_vertices(self.target.obj)[self.new]
        return dict(object=self.target.obj.name, length=self.result.length, edges=ends.tolist())


def find(target, until, seam_settings, seam_options, options, settings):
    """The `Cut` of a target, with nothing written.  A generator: yields the share that is done.

    until     "NEEDED" or "DISTORTION", as in `MeshOptions.cut`
    settings  that it is to be unwrapped with
    """
    seam_settings, seam_options = seam_settings or SeamSettings(), seam_options or SeamOptions()
    mesh = mesh_arrays.read(target.obj, options, seam_options.vertex_group)
    yield 0.0
    polygons = mesh.polygons(target.faces)
    if until == 'NEEDED':
        # What has to be cut is cut until it has a map, however much that stretches; the rest is not looked at again.
        opened = cut_open(polygons, seam_settings, mesh.wishes)
        target = target._replace(faces=_to_cut(opened, mesh))
        polygons = mesh.polygons(target.faces)
        seam_settings = dataclasses.replace(seam_settings, distortion=_ANY)
    steps = cut_to(polygons, seam_settings, mesh.wishes, _free(settings))
    result = yield from mapped(lambda state: state.done, steps)
    seams = result.seams | mesh.seam
    if mesh.welded_edge is not None:
        seams = (np.bincount(mesh.welded_edge, seams, len(seams)) > 0)[mesh.welded_edge]
    return Cut(target, dataclasses.replace(mesh, seam=seams), seams & ~mesh.seam, result)


_ANY = 100.0  # distortion, more than that of any map that is worth having


def _to_cut(opened, mesh):
    """The faces (f,) bool of the pieces that got new seams, or could not be opened."""
    new = (opened.seams & ~mesh.seam)[mesh.corner_edge]
    touched = np.bincount(mesh.corner_faces, new, len(mesh.face_start)) > 0
    faces = np.zeros(len(touched), dtype=bool)
    for chart in opened.charts:
        faces[chart.faces] = chart.error is not None or touched[chart.faces].any()
    return faces


def _free(settings):
    """What counts of the settings while it is cut: its outline is not held yet."""
    return Settings(balance=settings.balance)


def find_all(targets, until, seam_settings, seam_options, options, settings):
    """The cuts of all targets; yields the share that is done."""
    cuts = []
    for k, target in enumerate(targets):
        steps = find(target, until, seam_settings, seam_options, options, settings)
        cuts.append((yield from mapped(lambda share, k=k: (k + share) / len(targets), steps)))
    return cuts


def summary(cuts, charts):
    """What was cut, in one line; `charts` is the number of islands that there are then."""
    edges = sum(int(cut.new.sum()) for cut in cuts)
    if not edges:
        return "No new seams are needed"
    length = _joined([cut.result.length for cut in cuts], [cut.area for cut in cuts])
    text = f"{count(edges, 'edge')} marked as {'a seam' if edges == 1 else 'seams'}, {count(charts, 'island')}"
    return f"{text}, seam length {length:.2f} (relative to the root of the area)"


def _joined(lengths, areas):
    """The seam length of all meshes together by the root of their area."""
    total = sum(length * area**0.5 for length, area in zip(lengths, areas, strict=True))
    return total / sum(areas) ** 0.5 if sum(areas) > 0 else 0.0


def remarks(cuts):
    """What there is to say of the charts, as pairs of names and sentences."""
    for cut in cuts:
        charts = cut.result.charts
        for number, chart in enumerate(charts, start=1):
            name = cut.target.obj.name if len(charts) == 1 else f"{cut.target.obj.name}, piece {number}"
            for text in (*([str(chart.error)] if chart.error else []), *chart.warnings):
                yield name, text
