"""Small diagrams as SVG text: lines over time, paths in a plane, bars on a time line. Colours come from the page."""
import html
import itertools
import math
from typing import Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ...messages.batch import Array

WIDTH = 960
_LEFT, _RIGHT, _TOP, _BOTTOM = 76, 14, 8, 26
_BAR = 20
_CHARACTER = 6.6
_numbers = itertools.count(1)


class Line(NamedTuple):
    """One curve; ``style`` is a class of the page's style sheet."""

    style: str
    x: Array
    y: Array


class Bar(NamedTuple):
    """One bar on a time line, from ``start`` to ``end``; ``text`` is shown where it fits, ``hint`` on pointing."""

    start: float
    end: float
    style: str
    text: str
    hint: str


class Row(NamedTuple):
    """One row of a time line."""

    name: str
    bars: Sequence[Bar]


def ticks(low: float, high: float, most: int) -> List[float]:
    """Round numbers between two values, at most about ``most``."""
    span = high - low
    if not span > 0 or not math.isfinite(span):
        return [low]
    step = 10.0 ** math.floor(math.log10(span / max(most, 1)))
    step *= next(factor for factor in (1, 2, 2.5, 5, 10, 20) if span / (step * factor) <= most)
    first = math.ceil(low / step - 1e-9)
    return [number * step for number in range(first, int(math.floor(high / step + 1e-9)) + 1)]


def _number(value: float) -> str:
    return "%.6g" % (0.0 if abs(value) < 1e-12 else value)


def _tick(x: float, y: float, anchor: str, value: float) -> str:
    return '<text class="tick" x="%.1f" y="%.1f" text-anchor="%s">%s</text>' % (x, y, anchor, _number(value))


def _limits(values: Iterable[Array], least: float) -> Tuple[float, float]:
    low, high = math.inf, -math.inf
    for part in values:
        finite = part[np.isfinite(part)]
        if len(finite):
            low, high = min(low, float(finite.min())), max(high, float(finite.max()))
    if low > high:
        return -1.0, 1.0
    middle, half = 0.5 * (low + high), 0.5 * max(high - low, least, 1e-9)
    return middle - 1.08 * half, middle + 1.08 * half


def _path(style: str, x: Array, y: Array) -> str:
    good = np.isfinite(x) & np.isfinite(y)
    pieces = []
    pen_up = True
    for ok, a, b in zip(good.tolist(), x.tolist(), y.tolist()):
        if ok:
            pieces.append("%s%.1f %.1f" % ("M" if pen_up else "L", a, b))
        pen_up = not ok
    return '<path class="%s" d="%s"/>' % (style, "".join(pieces)) if pieces else ""


def _open(title: str, description: str, width: float, height: float) -> List[str]:
    name = "picture%d" % next(_numbers)
    return ['<svg viewBox="0 0 %g %g" role="img" aria-labelledby="%s-title %s-text">' % (width, height, name, name),
            '<title id="%s-title">%s</title>' % (name, html.escape(title)),
            '<desc id="%s-text">%s</desc>' % (name, html.escape(description))]


def _time_axis(low: float, high: float, top: float, bottom: float, unit: str) -> List[str]:
    scale = (WIDTH - _LEFT - _RIGHT) / max(high - low, 1e-12)
    parts = []
    for value in ticks(low, high, 10):
        at = _LEFT + (value - low) * scale
        parts.append('<path class="grid" d="M%.1f %.1fV%.1f"/>' % (at, top, bottom))
        parts.append(_tick(at, bottom + 15, "middle", value))
    parts.append('<text class="tick" x="%d" y="%.1f" text-anchor="end">%s</text>'
                 % (WIDTH - 2, bottom + 15, html.escape(unit)))
    return parts


def chart(title: str, description: str, lines: Sequence[Line], x_range: Tuple[float, float], unit: str,
          height: float = 150, mark: Optional[float] = None, band: Optional[Tuple[float, float]] = None,
          least: float = 0.0) -> str:
    """Curves over time.

    Args:
        title: For screen readers; the page has its own headings.
        description: What is to be seen, for screen readers.
        lines: The curves; later ones lie above.
        x_range: Time from, to, s.
        unit: Of the vertical axis.
        height: px.
        mark: A moment to be marked, s.
        band: Values that are allowed, from and to: drawn as a stripe.
        least: The vertical axis spans at least this.
    """
    low, high = x_range
    bottom = height - _BOTTOM
    y_low, y_high = _limits([line.y[(line.x >= low) & (line.x <= high)] for line in lines], least)
    if band is not None:
        y_low, y_high = min(y_low, 1.25 * band[0]), max(y_high, 1.25 * band[1])
    x_scale = (WIDTH - _LEFT - _RIGHT) / max(high - low, 1e-12)
    y_scale = (bottom - _TOP) / (y_high - y_low)
    parts = _open(title, description, WIDTH, height)
    if band is not None:
        parts.append('<rect class="band" x="%d" y="%.1f" width="%d" height="%.1f"/>'
                     % (_LEFT, bottom - (band[1] - y_low) * y_scale, WIDTH - _LEFT - _RIGHT,
                        (band[1] - band[0]) * y_scale))
    parts += _time_axis(low, high, _TOP, bottom, "s")
    for value in ticks(y_low, y_high, max(3, int(height / 30))):
        at = bottom - (value - y_low) * y_scale
        parts.append('<path class="grid" d="M%d %.1fH%d"/>' % (_LEFT, at, WIDTH - _RIGHT))
        parts.append(_tick(_LEFT - 6, at + 4, "end", value))
    parts.append('<text class="unit" x="4" y="%d">%s</text>' % (_TOP + 10, html.escape(unit)))
    if mark is not None and low <= mark <= high:
        parts.append('<path class="mark" d="M%.1f %dV%.1f"/>' % (_LEFT + (mark - low) * x_scale, _TOP, bottom))
    for line in lines:
        # one point beyond each edge, so that curves reach it
        first, last = np.searchsorted(line.x, low, "left") - 1, np.searchsorted(line.x, high, "right") + 1
        part = slice(max(int(first), 0), int(last))
        x = np.minimum(np.maximum(line.x[part], low - 0.05 * (high - low)), high + 0.05 * (high - low))
        parts.append(_path(line.style, _LEFT + (x - low) * x_scale, bottom - (line.y[part] - y_low) * y_scale))
    return "".join(parts) + "</svg>"


def plane(title: str, description: str, lines: Sequence[Line], labels: Tuple[str, str],
          mark: Optional[Tuple[float, float]] = None, size: float = 300) -> str:
    """Curves in a plane, both axes to the same scale."""
    x_low, x_high = _limits([line.x for line in lines], 1e-3)
    y_low, y_high = _limits([line.y for line in lines], 1e-3)
    left, bottom = 58.0, size - 34.0
    scale = min((size - left - 10) / (x_high - x_low), (bottom - 10) / (y_high - y_low))
    x_middle, y_middle = 0.5 * (x_low + x_high), 0.5 * (y_low + y_high)
    x_half, y_half = 0.5 * (size - left - 10) / scale, 0.5 * (bottom - 10) / scale
    x_low, x_high, y_low, y_high = x_middle - x_half, x_middle + x_half, y_middle - y_half, y_middle + y_half
    parts = _open(title, description, size, size)
    for value in ticks(x_low, x_high, 4):
        at = left + (value - x_low) * scale
        parts += ['<path class="grid" d="M%.1f 10V%.1f"/>' % (at, bottom), _tick(at, bottom + 14, "middle", value)]
    for value in ticks(y_low, y_high, 5):
        at = bottom - (value - y_low) * scale
        parts += ['<path class="grid" d="M%.1f %.1fH%.1f"/>' % (left, at, size - 10),
                  _tick(left - 5, at + 4, "end", value)]
    parts.append('<text class="unit" x="%.1f" y="%.1f" text-anchor="middle">%s</text>'
                 % (0.5 * (left + size), size - 4, html.escape(labels[0])))
    parts.append('<text class="unit" x="4" y="12">%s</text>' % html.escape(labels[1]))
    parts += [_path(line.style, left + (line.x - x_low) * scale, bottom - (line.y - y_low) * scale) for line in lines]
    if mark is not None:
        parts.append('<circle class="mark-point" cx="%.1f" cy="%.1f" r="6"/>'
                     % (left + (mark[0] - x_low) * scale, bottom - (mark[1] - y_low) * scale))
    return "".join(parts) + "</svg>"


def time_line(title: str, description: str, rows: Sequence[Row], x_range: Tuple[float, float],
              mark: Optional[float] = None) -> str:
    """Bars in rows over time."""
    low, high = x_range
    left = 190
    bottom = _TOP + _BAR * len(rows)
    scale = (WIDTH - left - _RIGHT) / max(high - low, 1e-12)
    parts = _open(title, description, WIDTH, bottom + _BOTTOM)
    for value in ticks(low, high, 8):
        at = left + (value - low) * scale
        parts += ['<path class="grid" d="M%.1f %dV%.1f"/>' % (at, _TOP, bottom),
                  _tick(at, bottom + 15, "middle", value)]
    for number, row in enumerate(rows):
        top = _TOP + _BAR * number
        parts.append('<text class="row" x="%d" y="%.1f" text-anchor="end">%s</text>'
                     % (left - 8, top + 14, html.escape(row.name)))
        for bar in row.bars:
            start, end = left + (max(bar.start, low) - low) * scale, left + (min(bar.end, high) - low) * scale
            if bar.end < low or bar.start > high:
                continue
            width = max(end - start, 2.0)
            parts.append('<g class="%s"><title>%s</title><rect x="%.1f" y="%d" width="%.1f" height="%d" rx="2"/>'
                         % (bar.style, html.escape(bar.hint), start, top + 2, width, _BAR - 4))
            if bar.text and len(bar.text) * _CHARACTER + 6 < width:
                parts.append('<text x="%.1f" y="%d">%s</text>' % (start + 4, top + 14, html.escape(bar.text)))
            parts.append("</g>")
    if mark is not None and low <= mark <= high:
        parts.append('<path class="mark" d="M%.1f %dV%.1f"/>' % (left + (mark - low) * scale, _TOP, bottom))
    return "".join(parts) + "</svg>"
