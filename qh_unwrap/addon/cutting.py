# SPDX-License-Identifier: GPL-3.0-or-later
"""New seams for the chosen faces of objects."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from ..core import Settings
from ..core.cuttable import need_cuts
from ..core.seam_settings import SeamSettings
from ..core.seams import cut_to
from ..core.searching import ChartSeams
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
    charts: list[ChartSeams]
    corner_uv: np.ndarray  # (c, 2) the maps that were found, as in `SeamResult`

    @property
    def area(self):
        """Of the target's faces, in the mesh's unit."""
        chosen = self.target.faces[self.mesh.corner_faces[self.mesh.corner_triangles[:, 0]]]
        triangles = self.mesh.corner_vertex[self.mesh.corner_triangles[chosen]]
        return float(areas_in_space(self.mesh.vertices, triangles).sum())

    @property
    def length(self):
        """Of all seams between two of the target's faces, each edge once, by the root of the area."""
        chosen = self.target.faces[self.mesh.corner_faces]
        uses = np.bincount(self.mesh.corner_edge[chosen], minlength=len(self.mesh.seam))
        lengths = self.mesh.polygons(self.target.faces).lengths
        return float(lengths[self.mesh.seam & (uses > 1)].sum() / self.area**0.5) if self.area > 0 else 0.0

    def to_dict(self):
        """JSON-ready; every edge by its vertices."""
        ends = mesh_arrays.edge_vertices(self.target.obj)[self.new]
        return dict(object=self.target.obj.name, length=self.length, edges=ends.tolist())


def find(target, until, seam_settings, seam_options, options, settings):
    """The `Cut` of a target, with nothing written.  A generator: yields the share that is done.

    until     "NEEDED" or "DISTORTION", as in `MeshOptions.cut`
    settings  that it is to be unwrapped with
    """
    seam_settings, seam_options = seam_settings or SeamSettings(), seam_options or SeamOptions()
    mesh = mesh_arrays.read(target.obj, options, seam_options.vertex_group)
    yield 0.0
    polygons = mesh.polygons(target.faces)
    wishes, free = mesh.wishes, _free(settings)
    if until == 'NEEDED':
        results = yield from _until_certified(mesh, polygons, seam_settings, wishes, free)
    else:
        results = [(yield from mapped(lambda state: state.done, cut_to(polygons, seam_settings, wishes, free)))]
    seams, corner_uv = mesh.seam.copy(), np.full((len(mesh.corner_vertex), 2), np.nan)
    for result in results:  # what a later one cuts was cut in vain before
        has_map = ~np.isnan(result.corner_uv[:, 0])
        beside = mesh.corner_edge[has_map]
        seams[beside] = result.seams[beside]
        corner_uv[has_map] = result.corner_uv[has_map]
    if mesh.welded_edge is not None:
        seams = (np.bincount(mesh.welded_edge, seams, len(seams)) > 0)[mesh.welded_edge]
    charts = [chart for result in results for chart in result.charts if _is_final(chart) or result is results[-1]]
    cut_mesh = dataclasses.replace(mesh, seam=seams)
    return Cut(target, cut_mesh, seams & ~mesh.seam, charts, corner_uv)


_BOUNDS = (100.0, 2.0, 1.1)  # distortions to try: at the first, hardly any map that is worth having is cut again


def _until_certified(mesh, polygons, settings, wishes, free):
    """The `SeamResult`s of what has to be cut, at ever smaller distortions of the pieces that had no certified map."""
    results, faces = [], _to_cut(polygons, settings)
    for bound in _BOUNDS if faces.any() else ():
        steps = cut_to(mesh.polygons(faces), dataclasses.replace(settings, distortion=bound), wishes, free)
        results.append((yield from mapped(lambda state: state.done, steps)))
        faces = np.zeros(len(faces), dtype=bool)
        for chart in results[-1].charts:
            faces[chart.faces] = not _is_final(chart)
        if not faces.any():
            break
    return results


def _to_cut(polygons, settings):
    """The faces (f,) bool of islands that are closed or have handles, or that are to be split into charts."""
    if settings.charts > 1:
        return polygons.selected
    islands = polygons.islands()
    faces = np.zeros(len(polygons.selected), dtype=bool)
    for island, needs_cut in zip(islands, need_cuts(islands), strict=True):
        faces[island.faces] = needs_cut
    return faces


def _is_final(chart):
    """Whether nothing more can be done for it: it has a certified map, or cannot have any."""
    return chart.certified or chart.error is not None


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
    length = _joined([cut.length for cut in cuts], [cut.area for cut in cuts])
    text = f"{count(edges, 'edge')} marked as {'a seam' if edges == 1 else 'seams'}, {count(charts, 'island')}"
    return f"{text}, seam length {length:.2f} (relative to the root of the area)"


def _joined(lengths, areas):
    """The seam length of all meshes together by the root of their area."""
    total = sum(length * area**0.5 for length, area in zip(lengths, areas, strict=True))
    return total / sum(areas) ** 0.5 if sum(areas) > 0 else 0.0


def remarks(cuts):
    """What there is to say of the charts, as pairs of names and sentences."""
    for cut in cuts:
        charts = cut.charts
        for number, chart in enumerate(charts, start=1):
            name = cut.target.obj.name if len(charts) == 1 else f"{cut.target.obj.name}, piece {number}"
            for text in (*([str(chart.error)] if chart.error else []), *chart.warnings):
                yield name, text
