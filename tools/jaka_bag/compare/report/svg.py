"""Small diagrams as SVG text: lines over time, paths in a plane, bars on a time line. Colours come from the page."""
import html
import itertools
import math
from typing import Any, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ...messages.batch import Array
from ..tolerances import Envelope

WIDTH = 960
"""Width of a picture, in its own units: a page scales it."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 76, 14, 8, 26
_BAR = 20
"""Height of a row, in the same units: a line of text and some air."""
_CHARACTER = 6.6
"""Width of a character, in the same units: a text that would be wider than its bar is left out."""
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


def bounded_row(name: str, bars: Sequence[Bar], most: int = 400) -> Row:
    """Return a row with at most so many bars; the name of one with more says so."""
    if len(bars) > most:
        name = "%s (first %d of %d)" % (name, most, len(bars))
    return Row(name, bars[:most])


def ticks(low: float, high: float, most: int) -> List[float]:
    """Round numbers between two values, at most about ``most``."""
    span = high - low
    if not span > 0 or not math.isfinite(span):
        return [low]
    step = 10.0 ** math.floor(math.log10(span / max(most, 1)))
    step *= next(factor for factor in (1, 2, 2.5, 5, 10, 20) if span / (step * factor) <= most)
    first = math.ceil(low / step - 1e-9)
    return [number * step for number in range(first, int(math.floor(high / step + 1e-9)) + 1)]


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


class _Picture:
    """One SVG with a rectangle to draw in: axes, and what all pictures have.

    Args:
        title: Title for screen readers; the page has its own headings.
        description: Description of the picture, for screen readers.
        size: Width and height, px.
        area: Left, right, top and bottom of the rectangle, px.
        x_range: Horizontal values at its left and right.
        y_range: Vertical values at its bottom and top.
    """

    def __init__(self, title: str, description: str, size: Tuple[float, float],
                 area: Tuple[float, float, float, float], x_range: Tuple[float, float],
                 y_range: Tuple[float, float] = (0.0, 1.0)) -> None:
        name = "picture%d" % next(_numbers)
        self.parts = [
            '<svg viewBox="0 0 %g %g" role="img" aria-labelledby="%s-title %s-text">' % (*size, name, name),
            '<title id="%s-title">%s</title>' % (name, html.escape(title)),
            '<desc id="%s-text">%s</desc>' % (name, html.escape(description))]
        self._left, self._right, self._top, self._bottom = area
        self.x_range, self._y_range = x_range, y_range
        self._x_scale = (self._right - self._left) / max(x_range[1] - x_range[0], 1e-12)
        self.y_scale = (self._bottom - self._top) / (y_range[1] - y_range[0])

    def x(self, value: Any) -> Any:
        """Return the horizontal place of a value or an array, px."""
        return self._left + (value - self.x_range[0]) * self._x_scale

    def y(self, value: Any) -> Any:
        """Return the vertical place of a value or an array, px."""
        return self._bottom - (value - self._y_range[0]) * self.y_scale

    def text(self, style: str, x: float, y: float, words: str, anchor: str = "start") -> None:
        """Draw text that begins, is centred or ends at a place."""
        self.parts.append('<text class="%s" x="%.1f" y="%.1f" text-anchor="%s">%s</text>'
                          % (style, x, y, anchor, html.escape(words)))

    def grid(self, along_x: int, along_y: int = 0) -> None:
        """Draw lines with their values, about ``along_x`` and ``along_y`` along the axes."""
        for value in ticks(*self.x_range, along_x):
            self.parts.append('<path class="grid" d="M%.1f %.1fV%.1f"/>' % (self.x(value), self._top, self._bottom))
            self.text("tick", self.x(value), self._bottom + 15, _number(value), "middle")
        for value in ticks(*self._y_range, along_y) if along_y else ():
            self.parts.append('<path class="grid" d="M%.1f %.1fH%.1f"/>' % (self._left, self.y(value), self._right))
            self.text("tick", self._left - 6, self.y(value) + 4, _number(value), "end")

    def mark(self, at: Optional[float]) -> None:
        """Draw a line at a moment; nothing for None or a moment outside."""
        if at is not None and self.x_range[0] <= at <= self.x_range[1]:
            self.parts.append('<path class="mark" d="M%.1f %.1fV%.1f"/>' % (self.x(at), self._top, self._bottom))

    def done(self) -> str:
        """Return the whole picture."""
        return "".join(self.parts) + "</svg>"


def _number(value: float) -> str:
    return "%.6g" % (0.0 if abs(value) < 1e-12 else value)


def chart(title: str, description: str, lines: Sequence[Line], x_range: Tuple[float, float], unit: str,
          height: float = 150, mark: Optional[float] = None, band: Optional[Tuple[float, float]] = None,
          least: float = 0.0, x_unit: str = "s", envelope: Envelope = ()) -> str:
    """Draw curves over time, or over the quantity with the unit ``x_unit``.

    Args:
        title: See ``_Picture``.
        description: See there.
        lines: The curves; later ones lie above.
        x_range: From, to, in ``x_unit``.
        unit: Unit of the vertical axis.
        height: Height, px.
        mark: Place of a mark, in ``x_unit``.
        band: Values that are allowed, from and to: drawn as a stripe.
        least: The vertical axis spans at least this.
        x_unit: Unit of the horizontal axis.
        envelope: Values that are allowed, from 0 to a limit that changes along the horizontal axis; likewise.
    """
    low, high = x_range
    bands = [] if band is None else [(low, high, band)]
    starts = [low, *[start for start, _ in envelope[1:]], high]
    bands += [(max(begin, low), min(end, high), (0.0, limit))
              for begin, end, (_, limit) in zip(starts, starts[1:], envelope) if begin < high and end > low]
    bottom, right = height - _BOTTOM, WIDTH - _RIGHT
    y_low, y_high = _limits([line.y[(line.x >= low) & (line.x <= high)] for line in lines], least)
    for _, _, (least_allowed, most_allowed) in bands:
        y_low, y_high = min(y_low, 1.25 * least_allowed), max(y_high, 1.25 * most_allowed)
    picture = _Picture(title, description, (WIDTH, height), (_LEFT, right, _TOP, bottom), x_range, (y_low, y_high))
    for begin, end, (least_allowed, most_allowed) in bands:
        picture.parts.append('<rect class="band" x="%.1f" y="%.1f" width="%.1f" height="%.1f"/>' % (
            picture.x(begin), picture.y(most_allowed), picture.x(end) - picture.x(begin),
            (most_allowed - least_allowed) * picture.y_scale))
    picture.grid(10, max(3, int(height / 30)))
    picture.text("tick", WIDTH - 2, bottom + 15, x_unit, "end")
    picture.text("unit", 4, _TOP + 10, unit)
    picture.mark(mark)
    for line in lines:
        # one point beyond each edge, so that curves reach it
        first, last = np.searchsorted(line.x, low, "left") - 1, np.searchsorted(line.x, high, "right") + 1
        part = slice(max(int(first), 0), int(last))
        x = np.minimum(np.maximum(line.x[part], low - 0.05 * (high - low)), high + 0.05 * (high - low))
        picture.parts.append(_path(line.style, picture.x(x), picture.y(line.y[part])))
    return picture.done()


def plane(title: str, description: str, lines: Sequence[Line], labels: Tuple[str, str],
          mark: Optional[Tuple[float, float]] = None, size: float = 300) -> str:
    """Draw curves in a plane, both axes to the same scale."""
    ranges = [_limits([line.x for line in lines], 1e-3), _limits([line.y for line in lines], 1e-3)]
    area = (58.0, size - 10.0, 10.0, size - 34.0)
    pixels = (area[1] - area[0], area[3] - area[2])
    scale = min(room / (high - low) for room, (low, high) in zip(pixels, ranges))
    x_range, y_range = (
        (0.5 * (low + high - room / scale), 0.5 * (low + high + room / scale))
        for room, (low, high) in zip(pixels, ranges))
    picture = _Picture(title, description, (size, size), area, x_range, y_range)
    picture.grid(4, 5)
    picture.text("unit", 0.5 * (area[0] + size), size - 4, labels[0], "middle")
    picture.text("unit", 4, 12, labels[1])
    picture.parts += [_path(line.style, picture.x(line.x), picture.y(line.y)) for line in lines]
    if mark is not None:
        picture.parts.append('<circle class="mark-point" cx="%.1f" cy="%.1f" r="6"/>'
                             % (picture.x(mark[0]), picture.y(mark[1])))
    return picture.done()


def time_line(title: str, description: str, rows: Sequence[Row], x_range: Tuple[float, float],
              mark: Optional[float] = None) -> str:
    """Draw bars in rows over time."""
    low, high = x_range
    left, bottom = 190, _TOP + _BAR * len(rows)
    picture = _Picture(title, description, (WIDTH, bottom + _BOTTOM), (left, WIDTH - _RIGHT, _TOP, bottom), x_range)
    picture.grid(8)
    for number, row in enumerate(rows):
        top = _TOP + _BAR * number
        picture.text("row", left - 8, top + 14, row.name, "end")
        for bar in row.bars:
            if bar.end < low or bar.start > high:
                continue
            start = picture.x(max(bar.start, low))
            width = max(picture.x(min(bar.end, high)) - start, 2.0)
            picture.parts.append(
                '<g class="%s"><title>%s</title><rect x="%.1f" y="%d" width="%.1f" height="%d" rx="2"/>'
                % (bar.style, html.escape(bar.hint), start, top + 2, width, _BAR - 4))
            if bar.text and len(bar.text) * _CHARACTER + 6 < width:
                picture.parts.append('<text x="%.1f" y="%d">%s</text>' % (start + 4, top + 14, html.escape(bar.text)))
            picture.parts.append("</g>")
    picture.mark(mark)
    return picture.done()
