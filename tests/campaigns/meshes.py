# SPDX-License-Identifier: GPL-3.0-or-later
"""Random meshes with seams, UVs, pins, selections and settings, each made from its seed alone."""

import bpy  # isort: skip  (the wheel knows bmesh only after this)
from dataclasses import dataclass, field, replace

import bmesh
import numpy as np

NEW, EARLIER = "a new map", "the result of an earlier unwrap"


@dataclass
class Case:
    """A mesh, all that the operator looks at, and how it is called."""

    points: np.ndarray  # (n, 3)
    faces: list  # of tuples of points
    seams: list = field(default_factory=list)  # of pairs of points
    uv: np.ndarray | str | None = None  # (c, 2) of the corners, `NEW`, `EARLIER`, or None: there is no map
    moved: np.ndarray | None = None  # (2, 3), where an affine map takes the UVs of an earlier unwrap before the next
    pins: np.ndarray | None = None  # (c,) bool, of the corners
    chosen: np.ndarray | None = None  # (f,) bool, what is selected in Edit Mode; None in Object Mode
    in_editor: bool = False  # whether the operator is called from the UV Editor
    scale: tuple = (1.0, 1.0, 1.0)  # of the object
    decorated: bool = False  # whether the mesh has all kinds of other data, which must not change
    settings: dict = field(default_factory=dict)

    def changed(self, **values):
        return replace(self, **values)


def random_case(seed):
    dice = np.random.default_rng(seed)
    size = int(np.exp(dice.uniform(0, np.log(500)))) + 1  # of about so many faces
    points, faces, seams = _joined(dice, size)
    points, faces, seams = _edited(dice, points, faces, seams)
    if not faces:
        points, faces, seams = _grid(dice, 4)
    points, faces = _damaged(dice, points, faces)
    seams = sorted(_more_seams(dice, faces, seams))
    case = Case(points, faces, seams, decorated=dice.random() < 0.2)
    if dice.random() < 0.2:
        case.scale = tuple(dice.choice([1, 1, 0.1, 3, 0.01, 0.001, -1], 3).tolist())
    if dice.random() < 0.55:
        case.chosen = _selection(dice, faces)
        case.in_editor = dice.random() < 0.3
    case.uv = _random_uv(dice, case)
    if case.uv is EARLIER and dice.random() < 0.3:
        case.moved = _movement(dice)
    _pin(dice, case)
    case.settings = _settings(dice, case)
    return case


def _joined(dice, size):
    """One to three primitives, apart, in one place or touching in a vertex."""
    parts = [_primitive(dice, max(1, size // count)) for count in [dice.choice([1, 1, 2, 3])] for _ in range(count)]
    points, faces, seams = np.empty((0, 3)), [], []
    for part, its_faces, its_seams in parts:
        part = part[:, dice.permutation(3)] if dice.random() < 0.5 else part
        if len(points):
            manner = dice.random()
            if manner < 0.4:
                part = part - part.min(axis=0) + [points[:, 0].max() + 1, 0, 0]
            elif manner < 0.9:
                part = part - part[dice.integers(len(part))] + points[dice.integers(len(points))]
        first = len(points)
        points = np.vstack([points, part])
        faces += [tuple(first + k for k in face) for face in its_faces]
        seams += [(first + a, first + b) for a, b in its_seams]
    return points, faces, seams


# Primitives: points (n, 3), faces as tuples of points, and seams as pairs of them that cut the surface open.


def _primitive(dice, size):
    makes = (_grid, _bumps, _tube, _sphere, _cone, _torus, _cube, _polygon, _band, _monkey)
    likely = np.array([4, 5, 5, 4, 3, 3, 2, 2, 0.7, 1 if size > 200 else 0])
    points, faces, seams = dice.choice(np.array(makes, dtype=object), p=likely / likely.sum())(dice, size)
    share = dice.choice([0, 0, 0.5, 1])  # of the quads that are cut in two
    cut = [face for face in faces if len(face) == 4 and dice.random() < share]
    whole = [face for face in faces if face not in cut]
    return points, [*whole, *(half for a, b, c, d in cut for half in ((a, b, c), (a, c, d)))], seams


def _sheet(n, m, round_n=False, round_m=False):
    """The quads of n by m cells in rows of m, or of m + 1 points where they do not close up."""
    across, along = m + (not round_m), n + (not round_n)

    def at(i, j):
        return (i % along) * across + j % across

    return [(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)) for i in range(n) for j in range(m)]


def _sides(dice, size, least=1):
    """Two numbers whose product is about `size`."""
    n = max(least, round(np.sqrt(size) * np.exp(dice.normal(0, 0.5))))
    return n, max(1, round(size / n))


def _lattice(n, m):
    i, j = np.meshgrid(np.arange(n + 1.0), np.arange(m + 1.0), indexing="ij")
    return np.column_stack([i.ravel(), j.ravel(), np.zeros(i.size)])


def _grid(dice, size):
    n, m = _sides(dice, size)
    return _lattice(n, m), _sheet(n, m), []


def _bumps(dice, size):
    points, faces, seams = _grid(dice, size)
    x, y = points[:, :2].T
    for _ in range(3):
        a, b, phase = *dice.normal(0, 2 / np.sqrt(size) + 0.1, 2), dice.uniform(0, 6)
        points[:, 2] += dice.choice([0.1, 0.5, 2]) * np.sin(a * x + b * y + phase)
    return points + dice.choice([0, 0.1]) * dice.normal(size=points.shape), faces, seams


def _circle(n):
    angle = 2 * np.pi * np.arange(n) / n
    return np.cos(angle), np.sin(angle)


def _tube(dice, size):
    """Open at both ends, at one or at none; its ends are polygons or fans; its radius may change."""
    n, m = _sides(dice, size, least=3)
    x, y = _circle(n)
    radius = 1 + dice.choice([0, 0.3, 0.9]) * np.sin(dice.uniform(0, 3) * np.arange(m + 1))
    height = dice.choice([0.1, 0.5, 2])
    points = np.vstack([np.column_stack([r * x, r * y, np.full(n, height * k)]) for k, r in enumerate(radius)])
    faces = _sheet(m, n, round_m=True)
    seams = [(k * n, k * n + n) for k in range(m)] if dice.random() < 0.5 else []
    for at_end in [False, True][: dice.integers(3)]:
        rim = [m * n + k for k in range(n)] if at_end else [n - 1 - k for k in range(n)]
        if dice.random() < 0.5:
            faces.append(tuple(rim))
        else:
            points = np.vstack([points, points[rim].mean(axis=0)])
            faces += [(rim[k - 1], rim[k], len(points) - 1) for k in range(n)]
        if dice.random() < 0.5:
            seams += [(rim[k - 1], rim[k]) for k in range(n)]
    return points, faces, seams


def _sphere(dice, size):
    n, m = _sides(dice, size, least=3)
    m = max(m, 2)
    x, y = _circle(n)
    polar = np.pi * np.arange(1, m) / m
    rings = [np.column_stack([np.sin(a) * x, np.sin(a) * y, np.full(n, np.cos(a))]) for a in polar]
    top, bottom = (m - 1) * n, (m - 1) * n + 1
    faces = _sheet(m - 2, n, round_m=True)
    faces += [(top, k, (k + 1) % n) for k in range(n)]
    faces += [((k + 1) % n + top - n, k + top - n, bottom) for k in range(n)]
    meridian = [(top, 0), *((k * n, k * n + n) for k in range(m - 2)), (top - n, bottom)]
    cut = len(meridian) if dice.random() < 0.7 else dice.integers(len(meridian) + 1)
    return np.vstack([*rings, [(0, 0, 1), (0, 0, -1)]]), faces, meridian[:cut]


def _cone(dice, size):
    n = max(3, size)
    x, y = _circle(n)
    points = np.vstack([np.column_stack([x, y, np.zeros(n)]), [(0, 0, dice.choice([0.1, 1, 10]))]])
    faces, seams = [(k, (k + 1) % n, n) for k in range(n)], []
    if dice.random() < 0.5:
        faces.append(tuple(range(n))[::-1])
        seams += [(k, (k + 1) % n) for k in range(n)]
    return points, faces, seams + ([(0, n)] if dice.random() < 0.5 else [])


def _torus(dice, size):
    n, m = (max(3, k) for k in _sides(dice, size, least=3))
    (x, y), (u, v) = _circle(n), _circle(m)
    radius = 1 + dice.choice([0.2, 0.5, 0.9]) * u
    height = np.tile(v, n)
    points = np.column_stack([np.outer(x, radius).ravel(), np.outer(y, radius).ravel(), height])
    ring = [(j, (j + 1) % m) for j in range(m)]
    length = [(i * m, (i + 1) % n * m) for i in range(n)]
    seams = [*(ring if dice.random() < 0.8 else ()), *(length if dice.random() < 0.8 else ())]
    return points, _sheet(n, m, round_n=True, round_m=True), seams


def _cube(dice, _size):
    points = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    tree = [(0, 1), (1, 3), (3, 2), (4, 5), (5, 7), (7, 6), (5, 1)]
    return points, faces, tree if dice.random() < 0.7 else []


def _polygon(dice, size):
    n = max(3, min(size, int(dice.integers(3, 13))))
    radius = 1 if dice.random() < 0.5 else dice.uniform(0.2, 1, n)  # else star-shaped
    x, y = _circle(n)
    return np.column_stack([radius * x, radius * y, np.zeros(n)]), [tuple(range(n))], []


def _band(dice, size):
    """A Möbius band."""
    n, m = max(5, size // 2), 2
    turn = np.repeat(2 * np.pi * np.arange(n) / n, m + 1)
    across = np.tile(np.arange(-1.0, 2), n)
    radius = 3 + across * np.cos(turn / 2)
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), across * np.sin(turn / 2)])
    faces = _sheet(n - 1, m)
    last = (n - 1) * (m + 1)
    return points, [*faces, *((last + j, m - j, m - j - 1, last + j + 1) for j in range(m))], []


def _monkey(_dice, _size):
    bm = bmesh.new()
    bmesh.ops.create_monkey(bm)
    points, faces, seams = _lists(bm)
    bm.free()
    return points, faces, seams


# What becomes of them


def _edited(dice, points, faces, seams):
    """Merged, dissolved and with faces deleted, as Blender does it."""
    mesh = bpy.data.meshes.new("case")
    mesh.from_pydata(points.tolist(), [], faces)
    bm = bmesh.new()
    bm.from_mesh(mesh)
    bpy.data.meshes.remove(mesh)
    pairs = {frozenset(pair) for pair in seams}
    for edge in bm.edges:
        edge.seam = frozenset(vert.index for vert in edge.verts) in pairs
    if dice.random() < 0.6:
        bmesh.ops.remove_doubles(bm, verts=bm.verts, dist=dice.choice([1e-4, 1e-4, 0.1]))
    if dice.random() < 0.25:
        share = dice.choice([0.02, 0.1, 0.3])
        edges = [edge for edge in bm.edges if len(edge.link_faces) == 2 and dice.random() < share]
        bmesh.ops.dissolve_edges(bm, edges=edges, use_verts=bool(dice.random() < 0.5), use_face_split=False)
    if dice.random() < 0.3:
        share = dice.choice([0.02, 0.1, 0.5])
        bmesh.ops.delete(bm, geom=[face for face in bm.faces if dice.random() < share], context='FACES')
    result = _lists(bm)
    bm.free()
    return result


def _lists(bm):
    bm.verts.index_update()
    points = np.array([vert.co for vert in bm.verts]).reshape(-1, 3)
    faces = [tuple(vert.index for vert in face.verts) for face in bm.faces]
    return points, faces, [tuple(vert.index for vert in edge.verts) for edge in bm.edges if edge.seam]


def _damaged(dice, points, faces):
    """Scaled unevenly, with spikes, with vertices on top of others, and with faces that are inside out or doubled."""
    if dice.random() < 0.2:
        points = points * 10.0 ** dice.uniform(-3, 0, 3)
    if dice.random() < 0.05:
        points = points * 10.0 ** dice.uniform(-5, 5) + dice.choice([0, 1000])
    if dice.random() < 0.1:
        points = points.copy()
        spikes = dice.choice(len(points), min(len(points), dice.integers(1, 4)))
        points[spikes] += dice.choice([0.1, 1, 10]) * np.ptp(points, axis=0).max() * dice.normal(size=(len(spikes), 3))
    if dice.random() < 0.15:
        points = points.copy()
        for _ in range(dice.integers(1, 4)):
            face = faces[dice.integers(len(faces))]
            at = dice.integers(len(face))
            points[face[at]] = points[face[at - 1]]
    if dice.random() < 0.25:
        share = dice.choice([0.02, 0.2, 0.5])
        faces = [face[::-1] if dice.random() < share else face for face in faces]
    if dice.random() < 0.2:
        share = dice.choice([0.02, 0.2, 1])
        doubles = [face for face in faces if dice.random() < share]
        turns = [dice.integers(len(face)) for face in doubles]  # a double may begin at any of its vertices
        doubles = [face[turn:] + face[:turn] for face, turn in zip(doubles, turns, strict=True)]
        faces = [*faces, *(face[::-1] if dice.random() < 0.5 else face for face in doubles)]
        if dice.random() < 0.5:
            faces = [faces[k] for k in dice.permutation(len(faces))]
    return points, faces


def edges_of(faces):
    return sorted({tuple(sorted((face[k - 1], face[k]))) for face in faces for k in range(len(face))})


def _more_seams(dice, faces, seams):
    """Some edges more, each for itself or on paths."""
    edges = edges_of(faces)
    kept = {tuple(sorted(pair)) for pair in seams} & set(edges)
    if dice.random() < 0.15:
        share = dice.choice([0.02, 0.1, 0.4, 1], p=[0.5, 0.4, 0.07, 0.03])
        kept |= {edge for edge in edges if dice.random() < share}
    if dice.random() < 0.3:
        around = {}
        for a, b in edges:
            around.setdefault(a, []).append(b)
            around.setdefault(b, []).append(a)
        for _ in range(dice.integers(1, 4)):
            at = edges[dice.integers(len(edges))][0]
            for _ in range(dice.integers(1, 3 + round(np.sqrt(len(edges))))):
                to = around[at][dice.integers(len(around[at]))]
                kept.add((min(at, to), max(at, to)))
                at = to
    return kept


def _selection(dice, faces):
    """All faces, some of them, or some that hang together."""
    manner = dice.random()
    if manner < 0.5:
        return np.ones(len(faces), bool)
    if manner < 0.75:
        chosen = dice.random(len(faces)) < dice.choice([0.3, 0.7, 0.95])
        chosen[dice.integers(len(faces))] = True
        return chosen
    by_point = {}
    for number, face in enumerate(faces):
        for point in face:
            by_point.setdefault(point, []).append(number)
    wanted = dice.integers(1, len(faces) + 1)
    found, waiting = set(), [int(dice.integers(len(faces)))]
    while waiting and len(found) < wanted:
        number = waiting.pop(dice.integers(len(waiting)))
        if number not in found:
            found.add(number)
            waiting += [other for point in faces[number] for other in by_point[point] if other not in found]
    return np.isin(np.arange(len(faces)), sorted(found))


def _random_uv(dice, case):
    manner = dice.random()
    if manner < 0.35:
        return None
    if manner < 0.5:
        return NEW
    if manner < 0.75:
        return EARLIER
    uv = _projected(dice, case)
    if dice.random() < 0.3:
        uv = moved(uv, _movement(dice))
    if dice.random() < 0.03:
        uv[dice.integers(len(uv))] = dice.choice([np.nan, np.inf])
    return uv


def _movement(dice):
    """Turned, perhaps mirrored, larger or smaller, and elsewhere: as rows of a matrix (2, 3)."""
    angle, size = dice.choice([0, dice.uniform(0, 6)]), dice.choice([1, 0.01, 30])
    mirrored = dice.choice([1, -1])
    turn = np.array([(np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))]) * (mirrored, 1)
    return np.column_stack([size * turn, dice.choice([0, 1, 10]) * dice.normal(size=2)])


def moved(uv, movement):
    return (uv @ movement[:, :2].T + movement[:, 2]).astype(np.float32)


def _projected(dice, case):
    """Each part, as seams bound it, seen from the side where it looks largest, beside the others."""
    corners = np.array([point for face in case.faces for point in face])
    start = np.cumsum([0, *(len(face) for face in case.faces)])
    part = _parts(case)
    uv, right = np.empty((len(corners), 2)), 0.0
    for number in range(max(part) + 1):
        its = [k for k in range(len(case.faces)) if part[k] == number]
        its_corners = np.concatenate([np.arange(start[k], start[k + 1]) for k in its])
        points = case.points[corners[its_corners]]
        normal = np.zeros(3)
        for k in its:
            around = case.points[list(case.faces[k])]
            normal += np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)
        normal /= np.linalg.norm(normal) or 1
        side = np.eye(3)[np.abs(normal).argmin()]
        side = np.cross(side, normal)
        side /= np.linalg.norm(side) or 1
        flat = points @ np.column_stack([side, np.cross(normal, side)])
        flat *= dice.choice([1, 0.1]) * np.array([dice.choice([1, 1, 1, -1]), 1])
        flat -= flat.min(axis=0)
        uv[its_corners] = flat + (right, 0)
        right += np.ptp(flat[:, 0]) + 0.1
    return (uv * dice.choice([1, 1 / max(right, 1e-9)])).astype(np.float32)


def _parts(case):
    """A number for the part of each face, as seams bound them."""
    closed = {frozenset(pair) for pair in case.seams}
    parent = list(range(len(case.faces)))

    def root(k):
        while parent[k] != k:
            k = parent[k]
        return k

    first = {}
    for number, face in enumerate(case.faces):
        for k in range(len(face)):
            pair = frozenset((face[k - 1], face[k]))
            if pair not in closed:
                parent[root(number)] = root(first.setdefault(pair, number))
    return np.unique([root(k) for k in range(len(case.faces))], return_inverse=True)[1].ravel().tolist()


def _pin(dice, case):
    """Pin some vertices, which may be moved as well; or the corners of some faces."""
    if case.uv is None or dice.random() < 0.7:
        return
    corners = np.array([point for face in case.faces for point in face])
    manner = dice.random()
    if manner < 0.6:
        pinned = dice.choice(corners, min(len(corners), dice.integers(1, 6)))
        case.pins = np.isin(corners, pinned)
    elif manner < 0.8:
        case.pins = np.isin(corners, np.unique(corners)[dice.random(len(np.unique(corners))) < 0.3])
    else:
        case.pins = dice.random(len(corners)) < dice.choice([0.02, 0.3, 1])
    if isinstance(case.uv, np.ndarray) and dice.random() < 0.3:
        point = dice.choice(corners[case.pins]) if case.pins.any() else corners[0]
        distance = dice.choice([0.01, 0.1]) * np.ptp(case.uv)
        case.uv[corners == point] += (distance * dice.normal(size=2)).astype(np.float32)


def _settings(dice, case):
    """Mostly the defaults."""
    settings = {}
    if dice.random() < 0.35:
        settings["boundary"] = str(dice.choice(['KEEP', 'KEEP', 'CIRCLE', 'RECTANGLE', 'OUTLINE']))
    if settings.get("boundary") == 'KEEP' and case.uv is None:
        del settings["boundary"]
    if dice.random() < 0.7:
        return settings
    choices = dict(
        placement=['ORIGINAL', 'UNIT', *(['PACK'] if len(case.faces) < 40 else [])],
        balance=[0.0, 0.1, 0.5, 1.0],
        iterations=[0, 1, 20],
        refine=[0, 3, 100],
        initial=['UNIFORM', 'HARMONIC', 'MEAN_VALUE', 'RINGS', 'CONFORMAL', 'PROJECTION', 'CURRENT'],
        aspect=[0.0, 2.0],
        repair=[False],
        fill_holes=[False],
        correct_scale=[False],
        correct_aspect=[False],
        margin=[0.0, 0.05],
    )
    if settings.get("boundary", 'FREE') != 'FREE':
        choices["weights"] = ['MEAN_VALUE', 'MEAN_VALUE_SCALAR', 'STRETCH']
    for name in dice.choice(sorted(choices), dice.integers(1, 4), replace=False):
        settings[str(name)] = choices[name][dice.integers(len(choices[name]))]
    return settings
