# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of surfaces and maps: a small rasteriser, and plots in one style."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

RED, GREEN, BLUE, GREY = "#c0392b", "#3a8f4a", "#2460a7", "#8a8a8a"
_LIGHT, _DARK = np.array([0.98, 0.97, 0.94]), np.array([0.16, 0.29, 0.44])
_FLIPPED, _CLAY = np.array([0.86, 0.16, 0.12]), np.array([0.86, 0.83, 0.78])
_SUPERSAMPLING = 3
_CHUNK = 2_000_000  # candidate pixels at a time

# Towards the viewer, and up
VIEWS = {
    "mannequin-devil": ((0.75, -1, 0.2), (0, 0, 1)),
    "camelhead": ((0.9, 0.25, 0.9), (0, 1, 0)),
    "face_bff": ((0.25, 0.05, 1), (0, 1, 0)),
    "demosthenes": ((0.4, 0.1, 1), (0, 1, 0)),
    "venus": ((0.4, 0.1, 1), (0, 1, 0)),
    "half-sphere": ((0.2, -0.7, 1), (0, 1, 0)),
}

plt.rcParams.update(
    {
        "font.size": 9,
        "axes.titlesize": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "0.9",
        "lines.linewidth": 1.4,
        "lines.markersize": 3.5,
        "legend.frameon": False,
        "savefig.dpi": 160,
        "savefig.bbox": "tight",
    }
)


def checkerboard(mesh, uv, view, squares=40, size=600):
    """A picture (h, w, 3) of a surface with a checkerboard mapped to it by `uv`.

    `view` is the direction towards the viewer and the one that is up; `squares` is their number along the side of a
    square as large as the layout.  Flipped triangles are red, the surface's inside is grey.
    """
    vertices, triangles = mesh
    axes = _camera(*view)
    points = vertices @ axes.T
    triangle, weights = _raster(points, triangles, size * _SUPERSAMPLING)
    covered = triangle >= 0
    corners, weights = triangles[triangle[covered]], weights[covered]
    signed = _signed_areas(uv[triangles])
    u, v = squares * np.einsum("pk,pkd->dp", weights, uv[corners]) / np.sqrt(abs(signed.sum()))
    colour = np.where(((np.floor(u) + np.floor(v)) % 2 == 0)[:, None], _LIGHT, _DARK)
    colour[(signed <= 0)[triangle[covered]]] = _FLIPPED
    normal = np.einsum("pk,pkd->pd", weights, (_vertex_normals(mesh) @ axes.T)[corners])
    inside = _signed_areas(points[triangles][:, :, :2])[triangle[covered]] < 0
    colour[inside] = 0.55
    normal[inside] *= -1
    return _picture(covered, colour * _brightness(normal)[:, None])


def layout(mesh, uv, view, size=600):
    """A picture (h, w, 3) of a layout with the surface's own shading, turned upright; flipped triangles are red."""
    triangles = mesh[1]
    axes = _camera(*view)
    flipped = _signed_areas(uv[triangles]) <= 0
    # Each triangle on its own, the flipped ones above the others
    points = np.dstack([_upright(uv, mesh[0] @ axes.T, triangles)[triangles], np.repeat(flipped, 3).reshape(-1, 3)])
    own_corners = np.arange(3 * len(triangles)).reshape(-1, 3)
    triangle, weights = _raster(points.reshape(-1, 3), own_corners, size * _SUPERSAMPLING, margin=0.01)
    covered = triangle >= 0
    corners, weights = triangles[triangle[covered]], weights[covered]
    colour = np.where(flipped[triangle[covered], None], _FLIPPED, _CLAY)
    normal = np.einsum("pk,pkd->pd", weights, (_vertex_normals(mesh) @ axes.T)[corners])
    return _picture(covered, colour * (0.4 * _brightness(normal) + 0.6 * _wrapped(normal))[:, None])


def wireframe(axes, uv, triangles):
    """Draw the edges of a layout in `axes`, flipped triangles filled."""
    flipped = _signed_areas(uv[triangles]) <= 0
    if flipped.any():
        axes.tripcolor(*uv.T, triangles[flipped], np.zeros(flipped.sum()), cmap=_plain(RED), alpha=0.35)
    axes.triplot(*uv.T, triangles, color="0.15", linewidth=0.25)
    axes.set_aspect("equal")
    axes.axis("off")


def contact_sheet(titles, *rows, names=(), width=2.6):
    """A figure of rows of pictures, the columns below their titles, the rows right of their names.

    `width` of a column in inches
    """
    shares = [max(picture.shape[0] / picture.shape[1] for picture in row) for row in rows]
    size = (width * len(titles), width * sum(shares) + 0.5)
    figure, axes = plt.subplots(len(rows), len(titles), figsize=size, height_ratios=shares, squeeze=False)
    figure.subplots_adjust(hspace=0.04, wspace=0.04)
    for axis, title in zip(axes[0], titles, strict=True):
        axis.set_title(title)
    for axis, picture in zip(axes.ravel(), (picture for row in rows for picture in row), strict=True):
        axis.imshow(picture, interpolation="lanczos")
        axis.set_anchor("N")
        axis.axis("off")
    for axis, name in zip(axes[:, 0], names, strict=False):
        axis.text(-0.04, 0.5, name, rotation="vertical", ha="right", va="center", transform=axis.transAxes)
    return figure


def plain_ticks(axis, ticks):
    """Numbers, not powers of ten, on a logarithmic axis."""
    axis.set_major_locator(matplotlib.ticker.FixedLocator(ticks))
    axis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
    axis.set_minor_formatter(matplotlib.ticker.NullFormatter())


def save(figure, folder, name):
    """Write a figure and say where."""
    figure.savefig(folder / name)
    plt.close(figure)
    print(f"picture: {folder / name}\n")


def _plain(colour):
    return matplotlib.colors.ListedColormap([colour])


def _camera(towards, up):
    back = np.asarray(towards, float) / np.linalg.norm(towards)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(back, right), back])


def _raster(points, triangles, size, margin=0.02):
    """The nearest triangle (h, w), -1 for none, and its corners' weights (h, w, 3), for points (n, 3) seen along -z."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    scale = (1 - 2 * margin) * size / (high - low).max()
    width, height = np.ceil((high - low) * scale + 2 * margin * size).astype(int)
    width, height = (side + -side % _SUPERSAMPLING for side in (width, height))
    xy = (points[:, :2] - (low + high) / 2) * scale
    xy = np.column_stack([xy[:, 0] + width / 2, height / 2 - xy[:, 1]])[triangles]
    z = points[triangles, 2]
    first = np.clip(np.ceil(xy.min(axis=1) - 0.5), 0, None).astype(int)
    count = np.clip(np.floor(xy.max(axis=1) - 0.5).astype(int) - first + 1, 0, None)
    total = count.prod(axis=1)

    nearest = np.full(height * width, -1)
    depth = np.full(height * width, -np.inf)
    weights = np.zeros((height * width, 3))
    for chosen in np.array_split(np.arange(len(triangles)), max(1, total.sum() // _CHUNK)):
        triangle = np.repeat(chosen, total[chosen])
        within = np.arange(len(triangle)) - np.repeat(np.cumsum(total[chosen]) - total[chosen], total[chosen])
        column = first[triangle, 0] + within % count[triangle, 0]
        row = first[triangle, 1] + within // count[triangle, 0]
        centre = np.column_stack([column, row]) + 0.5
        w = np.column_stack([_cross(xy[triangle, k] - centre, xy[triangle, k - 2] - centre) for k in (1, 2, 0)])
        area = w.sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            w /= area[:, None]
        hit = (w >= -1e-9).all(axis=1) & (area != 0)
        triangle, pixel, w = triangle[hit], (row * width + column)[hit], w[hit]
        here = np.einsum("pk,pk->p", w, z[triangle])
        order = np.argsort(here, kind="stable")  # of several on one pixel the last, the nearest, is kept
        order = order[here[order] > depth[pixel[order]]]
        depth[pixel[order]], nearest[pixel[order]], weights[pixel[order]] = here[order], triangle[order], w[order]
    return nearest.reshape(height, width), weights.reshape(height, width, 3)


def _cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _signed_areas(corners):
    return _cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def _vertex_normals(mesh):
    vertices, triangles = mesh
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    normal = np.zeros_like(vertices)
    for corner in triangles.T:
        np.add.at(normal, corner, np.cross(b - a, c - a))
    return normal


def _brightness(normal):
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    key, fill = np.array([-0.45, 0.55, 0.70]), np.array([0.70, 0.10, 0.70])
    lit = [np.clip(normal @ (light / np.linalg.norm(light)), 0, None) for light in (key, fill)]
    return np.clip(0.28 + 0.62 * lit[0] + 0.22 * lit[1], 0, 1)


def _wrapped(normal):
    # Light from the same side, that reaches round to the back
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    key = np.array([-0.45, 0.55, 0.70])
    return 0.45 + 0.55 * (0.5 + 0.5 * normal @ (key / np.linalg.norm(key)))


def _upright(uv, seen, triangles):
    """`uv` turned as the surface is `seen` (n, 3): the mean of its front faces' edges, by direction."""
    front = triangles[_signed_areas(seen[triangles][:, :, :2]) > 0]
    before, after = np.concatenate([front[:, :2], front[:, 1:]]).T
    (x, y), (a, b) = (uv[after] - uv[before]).T, (seen[after] - seen[before])[:, :2].T
    length = np.maximum(np.hypot(x, y), 1e-30)
    turn = np.sum((x - 1j * y) / length * (a + 1j * b))
    turned = turn / max(abs(turn), 1e-30) * (uv[:, 0] + 1j * uv[:, 1])
    return np.column_stack([turned.real, turned.imag])


def _picture(covered, colour):
    image = np.ones((*covered.shape, 3))
    image[covered] = np.clip(colour, 0, 1)
    height, width = (side // _SUPERSAMPLING for side in covered.shape)
    return image.reshape(height, _SUPERSAMPLING, width, _SUPERSAMPLING, 3).mean(axis=(1, 3))
