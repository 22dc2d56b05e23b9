# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of distortion curves, as lines and texts, and as SVG; needs no Blender."""

from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np

_WIDTH, _HEIGHT = 1200, 600  # pixels; y grows downwards
_PLOTS = ((85, 95, 500, 375), (670, 95, 500, 375))  # left, top, width, height
_SAMPLES = 600  # along a curve
_MOST = 1e4  # ratio up to which curves are shown
_OUTSIDE = 0.001  # of the triangles, those at each end of a curve that may lie outside the plot
_BLACK, _DARK, _LIGHT = "#000000", "#444444", "#dddddd"
_SIZE, _SMALL = 19, 15


class Line(NamedTuple):
    """A line through points."""

    points: np.ndarray  # (n, 2)
    colour: str  # "#rrggbb"
    width: float
    dashes: tuple = ()  # lengths that are drawn and left out, in turns


class Text(NamedTuple):
    """A line of text, whose baseline begins, has its middle or ends at a place."""

    text: str
    place: tuple
    size: float
    anchor: str = "start"  # as SVG names it: "start", "middle", "end"
    colour: str = _DARK


class Figure(NamedTuple):
    """All of them, from back to front."""

    width: int
    height: int
    lines: list
    texts: list


class Look(NamedTuple):
    """How a method's curve is drawn; the dashes tell curves apart for who does not see the colors."""

    colour: str
    width: float = 2.2
    dashes: tuple = ()


def distortion_figure(title, methods):
    """The `Figure` of the distortion curves of several methods, each with its name, its `Look` and its `Curves`.

    To the left is the ratio of the stretches of each triangle, to the right its relative area; each curve goes from the
    smallest value to the largest.
    """
    lines, texts = [], [Text(title, (_PLOTS[0][0], 36), _SIZE + 3, colour=_BLACK)]
    names = "larger / smaller stretch of each triangle", "area on the surface / area in the map"
    ascending = [(look, curves.ascending) for _, look, curves in methods]
    angles, areas = [[(look, getattr(its, name)) for look, its in ascending] for name in ("angle", "area")]
    high = max(_reach(values)[1] for _, values in angles)
    least, most = (each(_reach(values)[k] for _, values in areas) for k, each in enumerate((min, max)))
    limits = (1.0, np.clip(high, 1.1, _MOST)), (np.clip(least, 1 / _MOST, 1 / 1.2), np.clip(most, 1.2, _MOST))
    for plot, name, its, limit in zip(_PLOTS, names, (angles, areas), limits, strict=True):
        _add_axes(lines, texts, plot, name, limit)
        for look, values in its:
            lines.append(Line(_curve(values, plot, limit), *look))
    _add_legend(lines, texts, methods)
    return Figure(_WIDTH, _HEIGHT, lines, texts)


def _reach(ascending):
    """Between which values nearly all of them are."""
    finite = np.clip(ascending, 1e-30, 1e30)
    return float(np.quantile(finite, _OUTSIDE)), float(np.quantile(finite, 1 - _OUTSIDE))


def _place(values, plot, limit):
    """Where values are on the logarithmic axis of a plot, from top to bottom."""
    _, top, _, height = plot
    low, high = np.log(limit)
    return top + height * (high - np.log(np.clip(values, *limit))) / (high - low)


def _curve(ascending, plot, limit):
    left, _, width, _ = plot
    chosen = np.unique(np.linspace(0, len(ascending) - 1, min(len(ascending), _SAMPLES)).round().astype(int))
    along = chosen / max(len(ascending) - 1, 1)
    return np.column_stack([left + width * along, _place(ascending[chosen], plot, limit)])


def _add_axes(lines, texts, plot, name, limit):
    left, top, width, height = plot
    right, bottom = left + width, top + height
    for tick in ticks(*limit):
        y = float(_place(tick, plot, limit))
        ideal = tick == 1
        lines.append(Line(np.array([(left, y), (right, y)]), _DARK if ideal else _LIGHT, 1.2 if ideal else 1))
        texts.append(Text(f"{tick:.12g}", (left - 9, y + 5), _SMALL, "end"))
    for part in (0, 0.25, 0.5, 0.75, 1):
        x = left + part * width
        lines.append(Line(np.array([(x, top), (x, bottom)]), _LIGHT, 1))
        texts.append(Text(f"{100 * part:.0f} %", (x, bottom + 22), _SMALL, "middle"))
    frame = np.array([(left, top), (left, bottom), (right, bottom)])
    lines.append(Line(frame, _DARK, 1.2))
    texts.append(Text(name, (left, top - 14), _SIZE - 1))
    texts.append(Text("of the triangles", (left + width / 2, bottom + 43), _SMALL, "middle"))


def ticks(low, high):
    """Round numbers between two others, a handful."""
    decades = np.log10(high / low)
    finest = (1, 1.02, 1.05, 1.1, 1.2) if decades < 0.15 else (1, 1.2, 1.5, 2, 3, 5, 7)
    steps = finest if decades < 0.5 else (1, 2, 5) if decades < 2.5 else (1,)
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    found = [float(f"{step}e{exponent}") for exponent in exponents for step in steps]
    return [tick for tick in found if low * 0.999 <= tick <= high * 1.001]


def _add_legend(lines, texts, methods):
    x, y = _PLOTS[0][0], _HEIGHT - 42
    for name, look, _ in methods:
        width = 62 + 0.56 * _SIZE * len(name)
        if x + width > _WIDTH - 20:
            x, y = _PLOTS[0][0], y + 27
        lines.append(Line(np.array([(x, y - 6), (x + 44, y - 6)]), *look))
        texts.append(Text(name, (x + 54, y), _SIZE - 1, colour=_BLACK))
        x += width + 12


def as_svg(figure):
    """The figure as the text of an SVG file."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {figure.width} {figure.height}"'
    parts = [
        f'{head} width="{figure.width}" height="{figure.height}" font-family="sans-serif">',
        '<rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for line in figure.lines:
        points = " ".join(f"{x:.2f},{y:.2f}" for x, y in line.points)
        dashes = f' stroke-dasharray="{" ".join(map(str, line.dashes))}"' if line.dashes else ""
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{line.colour}" stroke-width="{line.width}"'
            f'{dashes} stroke-linejoin="round"/>'
        )
    for text in figure.texts:
        x, y = text.place
        parts.append(
            f'<text x="{x:.2f}" y="{y:.2f}" font-size="{text.size}" text-anchor="{text.anchor}"'
            f' fill="{text.colour}">{escape(text.text)}</text>'
        )
    return "\n".join([*parts, "</svg>\n"])
