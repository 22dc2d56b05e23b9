# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces of different character made from fixed seeds: vertices (n, 3) and triangles (m, 3), about as many as asked.

`hundred` makes those that quality is judged on, disks with and without holes; `islands` a mesh of many pieces.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import ConvexHull, Delaunay, KDTree

from qh_unwrap.core import Surface
from qh_unwrap.core.islands import find_islands

from ..core import shapes

FEWEST, MOST = 500, 20_000  # triangles of the hundred


def hundred():
    """The hundred surfaces by name, of every family in turn, their sizes log-uniform."""
    made = {}
    for number in range(100):
        family = FAMILIES[number % len(FAMILIES)]
        random = np.random.default_rng([2005, number])
        size = round(np.exp(random.uniform(np.log(FEWEST), np.log(MOST))))
        made[f"{family.__name__.replace('_', ' ')} {number}"] = family(random, size)
    return made


def hills(triangles, seed=1):
    """A round patch of gentle and steep hills with about so many irregular triangles."""
    plane, faces = _irregular_disk(np.random.default_rng(seed), triangles)
    tops = (0.35, 0.2, 0.9, 0.3), (-0.4, 0.3, 0.7, 0.2), (-0.1, -0.45, -0.6, 0.25), (0.5, -0.5, 0.3, 0.1)
    return np.column_stack([plane, _height(plane, tops)]), faces


def islands(count=5000):
    """A curved surface cut into pieces of 20 triangles that share no vertices, and the piece (m,) of every triangle."""
    random = np.random.default_rng(1)
    across = round(np.sqrt(count / 4))
    up = -(-count // (2 * across))
    columns, rows = 10 * across, 2 * up  # of quads; ten by two of them are two pieces
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    plane = np.stack([x, y], axis=-1) + random.uniform(-0.2, 0.2, (*x.shape, 2)) / (columns, rows)
    plane = plane.reshape(-1, 2)
    vertices = np.column_stack([plane, 0.3 * np.sin(5 * plane[:, 0]) * np.cos(6 * plane[:, 1])])
    quad_row, quad_column = (index.ravel() for index in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    faces = quads_halved(random, quad_row * (columns + 1) + quad_column, columns + 1)
    lengthwise = random.random((up, across)) < 0.5  # cut into two rows, else in the middle
    block_row, block_column = quad_row // 2, quad_column // 10
    second = np.where(lengthwise[block_row, block_column], quad_row % 2, quad_column % 10 // 5)
    piece = np.repeat(2 * (block_row * across + block_column) + second, 2)
    order = np.argsort(piece, kind="stable")[: 20 * count]
    faces, piece = faces[order], piece[order]
    corner, corners = np.unique(piece[:, None] * len(vertices) + faces, return_inverse=True)
    return vertices[corner % len(vertices)], corners.reshape(-1, 3), piece


# The families: a random generator and the number of triangles to a mesh


def rolling(random, size):
    """Round patches of soft and steep hills."""
    plane, faces = _irregular_disk(random, size)
    return np.column_stack([plane, _height(plane, _tops(random, random.integers(2, 8)))]), faces


def terrain(random, size):
    """Landscapes rough at every scale."""
    columns = round(np.sqrt(size / 2 * random.uniform(0.5, 2)))
    vertices, faces = _grid(random, columns, max(4, round(size / 2 / columns)))
    return _with_height(vertices, waves(random, vertices[:, :2], 7, random.uniform(0.9, 1.4))), faces


def curled_sheet(random, size):
    """Sheets rolled up for more than a turn, with dents."""
    long = random.uniform(1.5, 4)
    rows = max(4, round(np.sqrt(size / 2 / long)))
    vertices, faces = _grid(random, round(size / 2 / rows), rows, width=long)
    angle = random.uniform(1, 3) * np.pi * vertices[:, 0] / long
    radius = 0.3 * long * (1 + 0.12 * angle) + random.uniform(0.1, 0.6) * waves(random, vertices[:, :2], 4, 1.2)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), vertices[:, 1]]), faces


def bumpy_dome(random, size):
    """Spheres open at the bottom, from a shallow bowl to most of the ball, with bumps."""
    plane, faces = _irregular_disk(random, size)
    polar = random.uniform(0.35, 0.9) * np.pi * np.linalg.norm(plane, axis=1)
    azimuth = np.arctan2(plane[:, 1], plane[:, 0])
    directions = _directions(polar, azimuth)
    return directions * (1 + _lobes(random, directions, 12, (0.05, 0.4), (15, 60)))[:, None], faces


def star(random, size):
    """Star-shaped outlines with three to nine arms, on hills."""
    angle = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    arms, depth = random.integers(3, 10), random.uniform(0.2, 0.55)
    radius = 1 + depth * np.cos(arms * angle) + 0.1 * np.cos(angle + random.uniform(0, 6))
    plane, faces = _region(random, size, [radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])])
    return np.column_stack([plane, _height(plane, _tops(random, 4))]), faces


def plate_with_holes(random, size):
    """Bent and dented plates with two to six round holes."""
    turn = np.linspace(0, 2 * np.pi, 600, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    rounded = np.sign(circle) * np.abs(circle) ** 0.4
    centres, radii = [], []
    wanted = random.integers(2, 7)
    while len(radii) < wanted:
        centre, radius = random.uniform(-0.7, 0.7, 2), random.uniform(0.08, 0.25)
        if all(np.linalg.norm(centre - c) > radius + r + 0.12 for c, r in zip(centres, radii, strict=True)):
            centres.append(centre)
            radii.append(radius)
    holes = [centre + radius * circle for centre, radius in zip(centres, radii, strict=True)]
    plane, faces = _region(random, size, [rounded, *holes])
    bend = random.uniform(0.3, 1.2)
    out = 1 / bend + _height(plane, _tops(random, 3)) / 2
    angle = bend * plane[:, 0]
    return np.column_stack([out * np.sin(angle), plane[:, 1], out * np.cos(angle)]), faces


def long_strip(random, size):
    """Ribbons ten to forty times as long as wide, wavy and twisted."""
    long = random.uniform(10, 40)
    rows = max(3, round(np.sqrt(size / 2 / long)))
    vertices, faces = _grid(random, round(size / 2 / rows), rows, width=long)
    x, y, _ = vertices.T
    twist = random.uniform(0, 0.25) * x
    wave = random.uniform(0.5, 2) * np.sin(random.uniform(0.3, 1) * x)
    side = (y - 0.5) * (1 + 0.3 * np.sin(random.uniform(0.5, 2) * x))
    return np.column_stack([x, side * np.cos(twist) + 0.3 * wave, side * np.sin(twist) + wave]), faces


def spiral(random, size):
    """Ramps that wind round an axis and outwards, buckled."""
    turns = random.uniform(1.5, 4)
    long = 2 * np.pi * turns * 2
    rows = max(3, round(np.sqrt(size / 2 / long)))
    vertices, faces = _grid(random, round(size / 2 / rows), rows, width=long)
    x, y, _ = vertices.T
    angle = 2 * np.pi * turns * x / long
    radius = 1 + y + random.uniform(0, 1.2) * angle / (2 * np.pi)
    height = random.uniform(0.1, 0.5) * angle + random.uniform(0.02, 0.2) * np.sin(5 * x) * y
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height]), faces[:, ::-1]


def slit_blob(random, size):
    """Closed lumps, cut open along two shortest paths."""
    directions, faces = _sphere(random, size)
    vertices = directions * (1 + _lobes(random, directions, 8, (-0.3, 0.5), (2, 12)))[:, None]
    vertices *= random.uniform(0.6, 1.4, 3)
    return _cut_open(vertices, faces, random.choice(len(vertices), 3, replace=False))


def slit_torus(random, size):
    """Bumpy rings cut open along both of their circles."""
    thin = random.uniform(0.25, 0.6)
    rows = max(6, round(np.sqrt(size / 2 * thin)))
    vertices, faces = _grid(random, round(size / 2 / rows), rows, jitter=0)
    u, v = 2 * np.pi * vertices[:, :2].T
    for _ in range(4):  # periodic, so that both sides of the cut lie together
        waves = random.integers(-3, 4, 2) @ (u, v) + random.uniform(0, 6)
        v = v + 0.1 * np.sin(waves)
        u = u + 0.05 * np.cos(waves)
    around = random.integers(1, 5)
    tube = thin * (1 + random.uniform(0, 0.3) * np.cos(around * u) * np.sin(2 * v))
    radius = 1 + tube * np.cos(v)
    return np.column_stack([radius * np.cos(u), radius * np.sin(u), tube * np.sin(v)]), faces


def body(random, size):
    """Trunks with limbs, cut along the shortest paths between the ends of two or more of these."""
    directions, faces = _sphere(random, size)
    ends = random.normal(size=(random.integers(4, 7), 3))
    ends /= np.linalg.norm(ends, axis=1)[:, None]
    nearness = directions @ ends.T - 1
    limbs = random.uniform(0.6, 3, len(ends)) * np.exp(random.uniform(6, 14, len(ends)) * nearness)
    vertices = directions * (1 + limbs.sum(axis=1))[:, None]
    return _cut_open(vertices, faces, nearness.argmax(axis=0)[: random.integers(2, len(ends) + 1)])


def clustered(random, size):
    """Hills on triangles that are a hundred times as dense in some places as in others."""
    rim = max(16, round(np.sqrt(size)))
    turn = 2 * np.pi * np.arange(rim) / rim
    centres, spread = random.uniform(-0.6, 0.6, (5, 2)), random.uniform(0.02, 0.2, 5)
    which = random.integers(5, size=4 * size)
    points = centres[which] + spread[which, None] * random.normal(size=(4 * size, 2))
    wide = random.random(len(points)) < 0.3
    points[wide] = random.uniform(-1, 1, (wide.sum(), 2))
    points = points[np.linalg.norm(points, axis=1) < 1 - 3 / rim][: (size - rim) // 2]
    plane = np.vstack([points, np.column_stack([np.cos(turn), np.sin(turn)])])
    faces = _triangulated(plane)
    return np.column_stack([plane, _height(plane, _tops(random, 4))]), faces


def anisotropic(random, size):
    """Hills on triangles four to fifteen times as long as wide, all in one direction."""
    long, around, turn = random.uniform(4, 15), np.linspace(0, 2 * np.pi, 2000), random.uniform(0, np.pi)
    ellipse = np.column_stack([np.cos(around) / long, np.sin(around)])[:-1]
    plane, faces = _region(random, size, [ellipse])
    plane = plane * (long, 1) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return np.column_stack([plane, _height(plane, _tops(random, 4))]), faces


FAMILIES = (
    *(rolling, terrain, curled_sheet, bumpy_dome, star, plate_with_holes, long_strip),
    *(spiral, slit_blob, slit_torus, body, clustered, anisotropic),
)


# Plane and closed domains


def _irregular_disk(random, triangles):
    """Points (n, 2) of the unit disk in random order, and triangles between them."""
    rim = max(12, int(1.3 * np.sqrt(triangles)))
    inner = (triangles - rim) // 2
    step = np.sqrt(np.pi / inner)
    x, y = np.meshgrid(np.arange(-1, 1, step), np.arange(-1, 1, step))
    plane = np.column_stack([x.ravel(), y.ravel()]) + 0.35 * step * random.uniform(-1, 1, (x.size, 2))
    plane = plane[np.linalg.norm(plane, axis=1) < 1 - 0.6 * step]
    angle = 2 * np.pi * np.arange(rim) / rim
    plane = np.vstack([plane, np.column_stack([np.cos(angle), np.sin(angle)])])
    plane = plane[random.permutation(len(plane))]
    return plane, _triangulated(plane)


def _region(random, size, curves):
    """Points (n, 2) within the first of the closed curves (k, 2) and outside the others, and triangles between them."""
    area = np.abs([_enclosed_area(curve) for curve in curves])
    step = np.sqrt(2 * (area[0] - area[1:].sum()) / size)
    rims = [_evenly_spaced(curve, 0.7 * step) for curve in curves]
    low, high = rims[0].min(axis=0), rims[0].max(axis=0)
    x, y = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
    points = np.column_stack([x.ravel(), y.ravel()]) + 0.3 * step * random.uniform(-1, 1, (x.size, 2))
    points = points[_inside(points, rims)]
    points = points[KDTree(np.vstack(rims)).query(points)[0] > 0.7 * step]
    plane = np.vstack([points, *rims])
    faces = _triangulated(plane)
    return _largest_piece(plane, faces[_inside(plane[faces].mean(axis=1), rims)])


def _grid(random, columns, rows, width=1.0, jitter=0.25):
    """A flat rectangle of irregular quads halved at random, 1 high."""
    vertices, _ = shapes.grid(columns, rows, width)
    x, y, _ = vertices.T
    moved = random.uniform(-jitter, jitter, (len(vertices), 2)) * (width / columns, 1 / rows)
    vertices[:, 0] += np.where((x > 0) & (x < width), moved[:, 0], 0)
    vertices[:, 1] += np.where((y > 0) & (y < 1), moved[:, 1], 0)
    corner = np.add.outer(np.arange(rows) * (columns + 1), np.arange(columns)).ravel()
    return vertices, quads_halved(random, corner, columns + 1)


def quads_halved(random, corner, row):
    """Two triangles for every quad of a grid, along either diagonal; `row` is how far the next row's vertices are."""
    a, b, c, d = corner, corner + 1, corner + row + 1, corner + row
    one = np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1)
    other = np.stack([np.column_stack([a, b, d]), np.column_stack([b, c, d])], axis=1)
    return np.where((random.random(len(corner)) < 0.5)[:, None, None], one, other).reshape(-1, 3)


def _sphere(random, size):
    """Directions (n, 3), evenly spread but for some noise, and the triangles between them, seen from outside."""
    n = size // 2 + 2
    k = np.arange(n) + 0.5
    directions = _directions(np.arccos(1 - 2 * k / n), np.pi * (1 + np.sqrt(5)) * k)
    directions += random.uniform(-1, 1, (n, 3)) * 0.4 / np.sqrt(n)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    faces = ConvexHull(directions).simplices
    a, b, c = directions[faces].transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return directions, faces


def _cut_open(vertices, faces, ends):
    """The closed surface with seams along the shortest paths from the first of the vertices `ends` to the others."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges, side_edge = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    one, other = edges.T
    length = np.linalg.norm(vertices[one] - vertices[other], axis=1)
    graph = coo_array((length, (one, other)), shape=(len(vertices),) * 2).tocsr()
    before = dijkstra(graph, directed=False, indices=ends[0], return_predecessors=True)[1]
    seams = set()
    for vertex in ends[1:].tolist():
        while vertex != ends[0]:
            seams.add((min(vertex, before[vertex]), max(vertex, before[vertex])))
            vertex = before[vertex]
    seam = np.array([tuple(edge) in seams for edge in edges.tolist()])
    corners = np.arange(faces.size)
    everything = np.ones(len(faces), bool)
    (island,) = find_islands(faces.ravel(), side_edge.ravel(), corners[::3], seam, everything, corners.reshape(-1, 3))
    return vertices[island.vertices], island.triangles


# What makes them curved


def _tops(random, count):
    """Hills and hollows: x, y, height, width."""
    place, width = random.uniform(-0.6, 0.6, (count, 2)), random.uniform(0.12, 0.4, count)
    return np.column_stack([place, width * random.uniform(0.8, 2.8, count) * random.choice([-1, 1], count), width])


def _height(plane, tops):
    x, y = plane.T
    height = np.zeros(len(plane))
    for u, v, tall, width in tops:
        height += tall * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * width**2))
    return height


def waves(random, plane, octaves, smoothness):
    """Noise of about unit slope: in every octave waves in four directions, the shorter the lower."""
    height = np.zeros(len(plane))
    for octave in range(octaves):
        for angle, phase in random.uniform(0, 2 * np.pi, (4, 2)):
            frequency = 3 * 2**octave
            wave = np.sin(frequency * plane @ (np.cos(angle), np.sin(angle)) + phase)
            height += wave / 3 / 2 ** (octave * smoothness)
    return height


def _lobes(random, directions, count, height, sharpness):
    """Bumps on a sphere, their heights and sharpnesses from ranges."""
    centres = random.normal(size=(count, 3))
    centres /= np.linalg.norm(centres, axis=1)[:, None]
    nearness = directions @ centres.T - 1
    return np.exp(random.uniform(*sharpness, count) * nearness) @ random.uniform(*height, count)


def _directions(polar, azimuth):
    return np.column_stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])


def _with_height(vertices, height):
    return np.column_stack([vertices[:, :2], height])


# Plane geometry


def _triangulated(plane):
    """The Delaunay triangles (t, 3) of points (n, 2), counter-clockwise."""
    faces = Delaunay(plane).simplices
    a, b, c = plane[faces].transpose(1, 0, 2)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces[area < 0] = faces[area < 0][:, ::-1]
    return faces[np.abs(area) > 1e-9 * np.abs(area).mean()]  # not those between three points of a straight outline


def _enclosed_area(curve):
    x, y = curve.T
    return (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2


def _evenly_spaced(curve, step):
    """Points of the closed curve (k, 2) about one step apart."""
    closed = np.vstack([curve, curve[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, along[-1], max(12, round(along[-1] / step)), endpoint=False)
    return np.column_stack([np.interp(at, along, coordinate) for coordinate in closed.T])


def _inside(points, curves):
    """Whether the points (n, 2) lie within an odd number of the closed curves."""
    inside = np.zeros(len(points), bool)
    px, py = points.T
    for curve in curves:
        for (ax, ay), (bx, by) in zip(curve, np.roll(curve, -1, axis=0), strict=True):
            if ay != by:
                inside ^= ((ay > py) != (by > py)) & (px < ax + (py - ay) / (by - ay) * (bx - ax))
    return inside


def _largest_piece(points, faces):
    """The largest part whose faces hang together across edges, without the vertices that it does not use."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edge = np.unique(sides, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(edge[order][1:] == edge[order][:-1])
    one, other = order[same] // 3, order[same + 1] // 3
    links = coo_array((np.ones(len(one)), (one, other)), shape=(len(faces),) * 2)
    piece = connected_components(links, directed=False)[1]
    kept, faces = np.unique(faces[piece == np.bincount(piece).argmax()], return_inverse=True)
    return points[kept], faces.reshape(-1, 3)


def main():
    """Say what the hundred are; fails where one is no disk with holes."""
    for name, (vertices, triangles) in hundred().items():
        surface = Surface(vertices, triangles)
        print(f"{name:<24}{len(triangles):>7} triangles, {len(surface.loops)} loops, {surface.degenerate.sum()} flat")


if __name__ == "__main__":
    main()
