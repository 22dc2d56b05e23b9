# SPDX-License-Identifier: GPL-3.0-or-later
"""Making a case that fails as small and plain as it can be and still fail."""

import numpy as np

from .meshes import NEW


def shrunk(case, fails):
    """The smallest case found for which `fails(case)` still holds."""
    while True:
        before = _size(case)
        for smaller in _WAYS:
            case = smaller(case, fails)
        if _size(case) == before:
            return case


def _size(case):
    return written(case)


def without_faces(case, dropped):
    """The case without these faces, (f,) bool, and without points that belong to none."""
    kept = [k for k in range(len(case.faces)) if not dropped[k]]
    corner_kept = np.repeat(~dropped, [len(face) for face in case.faces])
    faces = [case.faces[k] for k in kept]
    used = sorted({point for face in faces for point in face})
    number = {point: k for k, point in enumerate(used)}
    edges = {frozenset((face[k - 1], face[k])) for face in faces for k in range(len(face))}
    return case.changed(
        points=case.points[used],
        faces=[tuple(number[point] for point in face) for face in faces],
        seams=[(number[a], number[b]) for a, b in case.seams if frozenset((a, b)) in edges],
        uv=case.uv[corner_kept] if isinstance(case.uv, np.ndarray) else case.uv,
        pins=None if case.pins is None else case.pins[corner_kept],
        chosen=None if case.chosen is None else case.chosen[~dropped],
    )


def _fewer_faces(case, fails):
    return _fewer(case, fails, lambda its: len(its.faces), without_faces)


def _fewer_seams(case, fails):
    def without(case, dropped):
        return case.changed(seams=[pair for pair, gone in zip(case.seams, dropped, strict=True) if not gone])

    return _fewer(case, fails, lambda its: len(its.seams), without)


def _fewer_pins(case, fails):
    if case.pins is None:
        return case

    def without(case, dropped):
        pins = case.pins.copy()
        pins[np.flatnonzero(pins)[dropped]] = False
        return case.changed(pins=pins)

    case = _fewer(case, fails, lambda its: int(its.pins.sum()), without)
    plain = case.changed(pins=None)
    return plain if not case.pins.any() and fails(plain) else case


def _fewer(case, fails, count, without):
    """Drop portions of what there are `count(case)` of, ever smaller ones."""
    portion = count(case) // 2 or 1
    while True:
        start = 0
        while start < count(case):
            dropped = np.zeros(count(case), bool)
            dropped[start : start + portion] = True
            smaller = None if count(case) == dropped.sum() and without is without_faces else without(case, dropped)
            if smaller is not None and fails(smaller):
                case = smaller
            else:
                start += portion
        if portion == 1:
            return case
        portion //= 2


def _fewer_points(case, fails):
    """Collapse edges, and leave points out of faces."""
    for face in range(len(case.faces)):
        for at in range(len(case.faces[face]) if face < len(case.faces) else 0):
            if face < len(case.faces) and at < len(case.faces[face]):
                ring = case.faces[face]
                smaller = _collapsed(case, ring[at - 1], ring[at])
                if smaller is not None and fails(smaller):
                    case = smaller
                elif len(ring) > 3:
                    smaller = _without_corners(case, lambda f, k, face=face, at=at: (f, k) == (face, at))
                    if smaller is not None and fails(smaller):
                        case = smaller
    return case


def _collapsed(case, a, b):
    """The case with the point b merged into a."""
    seen = set()

    def dropped(f, k):
        point = a if case.faces[f][k] == b else case.faces[f][k]
        if k == 0:
            seen.clear()
        double = point in seen
        seen.add(point)
        return double

    points = case.points.copy()
    merged = _without_corners(case, dropped)
    if merged is None:
        return None
    faces = [tuple(a if point == b else point for point in face) for face in merged.faces]
    seams = {tuple(sorted(a if point == b else point for point in pair)) for pair in merged.seams}
    merged = merged.changed(points=points, faces=faces, seams=sorted(pair for pair in seams if pair[0] != pair[1]))
    return without_faces(merged, np.zeros(len(faces), bool))


def _without_corners(case, dropped):
    """The case without the corners of which `dropped(face, place)` holds, and without faces that have too few then."""
    kept = [[not dropped(f, k) for k in range(len(face))] for f, face in enumerate(case.faces)]
    corner_kept = np.concatenate(kept)
    faces = [
        tuple(point for point, stays in zip(face, its, strict=True) if stays)
        for face, its in zip(case.faces, kept, strict=True)
    ]
    smaller = case.changed(
        faces=faces,
        uv=case.uv[corner_kept] if isinstance(case.uv, np.ndarray) else case.uv,
        pins=None if case.pins is None else case.pins[corner_kept],
    )
    few = np.array([len(face) < 3 for face in faces])
    return None if few.all() else without_faces(smaller, few)


def _plainer(case, fails):
    """Default settings, nothing but the mesh, whole numbers."""
    for name in list(case.settings):
        smaller = case.changed(settings={key: value for key, value in case.settings.items() if key != name})
        case = smaller if fails(smaller) else case
    for values in (
        dict(decorated=False),
        dict(in_editor=False),
        dict(chosen=None, in_editor=False),
        dict(scale=(1.0, 1.0, 1.0)),
        dict(pins=None),
        dict(uv=None, pins=None),
        dict(uv=NEW),
    ):
        same = all(np.array_equal(getattr(case, name), value) for name, value in values.items())
        needless = values == dict(uv=NEW) and case.uv is None
        if not same and not needless:
            smaller = case.changed(**values)
            case = smaller if fails(smaller) else case
    if case.chosen is not None and not case.chosen.all():
        smaller = case.changed(chosen=np.ones(len(case.faces), bool))
        case = smaller if fails(smaller) else case
    return _rounder(case, fails)


def _rounder(case, fails):
    for name in ("points", "uv"):
        values = getattr(case, name)
        if not isinstance(values, np.ndarray):
            continue
        for digits in range(6):
            rounded = np.round(np.asarray(values, float), digits) + 0.0
            smaller = case.changed(**{name: rounded})
            if np.array_equal(rounded, values):
                break
            if fails(smaller):
                case = smaller
                break
        case = _rounder_one_by_one(case, fails, name)
    return case


def _rounder_one_by_one(case, fails, name):
    """Round single coordinates further than all together can be."""
    values = np.asarray(getattr(case, name), float)
    if values.size > 120:
        return case
    for place in np.ndindex(values.shape):
        for digits in (0, 1, 2, 3):
            rounded = values.copy()
            rounded[place] = np.round(values[place], digits) + 0.0
            if rounded[place] == values[place]:
                break
            if fails(case.changed(**{name: rounded})):
                values = rounded
                break
    return case.changed(**{name: values})


_WAYS = (_plainer, _fewer_faces, _fewer_seams, _fewer_pins, _fewer_points)


def written(case):
    """The case as Python."""
    values = dict(points=np.asarray(case.points, float).tolist(), faces=[tuple(map(int, f)) for f in case.faces])
    if case.seams:
        values["seams"] = [tuple(map(int, pair)) for pair in case.seams]
    if case.uv is not None:
        values["uv"] = case.uv.tolist() if isinstance(case.uv, np.ndarray) else case.uv
    if case.pins is not None:
        values["pinned_corners"] = np.flatnonzero(case.pins).tolist()
    if case.chosen is not None:
        values["edit_mode"] = "all" if case.chosen.all() else np.flatnonzero(case.chosen).tolist()
    if case.in_editor:
        values["in_editor"] = True
    if tuple(case.scale) != (1, 1, 1):
        values["scale"] = tuple(case.scale)
    if case.decorated:
        values["decorated"] = True
    values["settings"] = case.settings
    return "\n".join(f"    {name} = {value}" for name, value in values.items())
