"""Many runs against one golden log as one HTML page that needs no network and no scripts."""
import math
import os
from html import escape
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from jaka_bag.compare.report.html import definitions, figures_of, page
from jaka_bag.compare.report.pictures import Figure
from jaka_bag.compare.report.svg import Bar, Line, Row, chart, time_line
from jaka_bag.compare.tolerances import as_yaml
from jaka_bag.messages.batch import Array
from jaka_bag.units import NS_PER_S

from .history import CYCLE, Cell, RunHistory, Series
from .outcome import DIFFERENT, SAME, RunOutcome, worst_first
from .store import Setup
from .summary import WORST, day, drift_title, drift_words, run_words, shown, shown_slope

_MOST_CELLS = 12
"""Number of cells that are drawn; the tables have all."""
_MOST_ROWS = 400
"""Most cells in the picture: one more row each."""
_MOST_BARS = 1500
"""Most runs of a cell in the picture: more than it has pixels across."""
_MOST_DRIFTS = 20
"""Drifts with a picture; the rest is listed."""
_DRAWN_UP_TO = 2.5
"""Margins beyond are drawn here: one wild run would make all others a line at the bottom."""
_DAY_NS = 86400 * NS_PER_S
_LINES = 8
"""Number of colours of lines; further ones begin again."""
_MORE_STYLE = """
:root{--l0:#1d4fd7;--l1:#dc2626;--l2:#15803d;--l3:#8b2fc9;--l4:#a16207;--l5:#0e7490;--l6:#be185d;--l7:#5b6675}
@media (prefers-color-scheme:dark){:root{--l0:#7aa5ff;--l1:#ff8a80;--l2:#6fdc95;--l3:#cf9bf5;--l4:#f0b62e;
--l5:#5fd0e6;--l6:#ff8fc0;--l7:#a3afbf}}
.l0{stroke:var(--l0)}.l1{stroke:var(--l1)}.l2{stroke:var(--l2)}.l3{stroke:var(--l3)}.l4{stroke:var(--l4)}
.l5{stroke:var(--l5)}.l6{stroke:var(--l6)}.l7{stroke:var(--l7)}
.l0,.l1,.l2,.l3,.l4,.l5,.l6,.l7{stroke-width:1.4;stroke-linejoin:round}
.fit{stroke:var(--text);stroke-width:1.6;stroke-dasharray:7 4}
.legend .fit::before{border-top:2px dashed var(--text)}
.run rect{stroke:none}.run.same rect{fill:var(--good)}.run.different rect{fill:var(--bad)}
.run.left rect{fill:var(--faint)}
.legend .box::before{width:11px;height:11px;border:0;background:var(--k)}
.verdict.drift{background:var(--bad-soft);border-color:var(--golden)}.verdict.drift h1{color:var(--text)}
tr.drift th,tr.drift td{background:var(--bad-soft)}
#margins h3{margin-top:26px}
"""


class Section(NamedTuple):
    """A part of the page: its name in links, its heading, its HTML."""

    name: str
    heading: str
    body: str


def _legend(names: Iterable[str], further: str = "") -> str:
    return '<p class="legend">%s%s</p>' % ("".join(
        '<span style="--k:var(--l%d)">%s</span>' % (i % _LINES, escape(name)) for i, name in enumerate(names)), further)


_BAND = '<span class="band">within the limit</span>'
_MARK = '<span class="mark">first run that drifted</span>'


def _run_axis(runs: Sequence[RunOutcome]) -> Tuple[float, float]:
    """Return the range of run numbers, with room for the axis' name behind the last one."""
    return 0.0, 1.045 * len(runs) + 1.0


def _margin_chart(title: str, cell: Cell, margins: Mapping[str, Array], mark: Optional[float]) -> str:
    number = np.arange(1, len(cell.runs) + 1, dtype=float)
    lines = [Line("l%d" % (i % _LINES), number, np.minimum(values, _DRAWN_UP_TO))
             for i, values in enumerate(margins.values())]
    return chart(title, "How near each run was to the limits, over the runs; 1 is the limit.", lines,
                 _run_axis(cell.runs), "limits", 190, mark, (0.0, 1.0), x_unit="run")


def _cell_title(cell: str) -> str:
    return cell or "all runs"


def _first_drift(history: RunHistory, cell: str, joints: bool) -> Optional[float]:
    """Return the number, from 1, of the run at which a cell's strongest drift begins; of joints, or of anything."""
    for series in history.drifts:
        if series.cell == cell and (series.is_joint or not joints) and series.first_changed is not None:
            return series.first_changed + 1.0
    return None


def _drawn(history: RunHistory) -> List[Cell]:
    """Return the cells that are drawn: those that drift, then those that come nearest to a limit."""
    drifting = [series.cell for series in history.drifts]

    def order(cell: Cell) -> Tuple[int, float]:
        margins = [run.margin for run in cell.runs if run.margin is not None]
        return (drifting.index(cell.name) if cell.name in drifting else len(drifting)), -max(margins, default=0.0)

    return sorted(history.cells, key=order)[:_MOST_CELLS]


def _margins(history: RunHistory) -> str:
    parts = []
    for cell in _drawn(history):
        mark = _first_drift(history, cell.name, True)
        marked = _MARK if mark is not None else ""
        if cell.joints:
            parts.append("<h3>%s: joints</h3>%s%s" % (
                escape(_cell_title(cell.name)), _legend(cell.joints, _BAND + marked),
                _margin_chart("Margins of the joints, %s" % _cell_title(cell.name), cell, cell.joints, mark)))
        if cell.groups:
            parts.append("<h3>%s: other checks</h3>%s%s" % (
                escape(_cell_title(cell.name)), _legend(cell.groups, _BAND),
                _margin_chart("Margins of the other checks, %s" % _cell_title(cell.name), cell, cell.groups, None)))
        cycle = [series for series in cell.series if series.name == CYCLE]
        parts += [figures_of([_series_figure(series, cell.runs)]) for series in cycle if len(series.number) > 1]
    rest = len(history.cells) - _MOST_CELLS
    return "<p>Each line is how near a check came to its limit, run by run: 1 is the limit; what is more than %g is " \
           "drawn there.</p>%s%s" % (_DRAWN_UP_TO, "".join(parts), "<p>%d more cells are not drawn.</p>" % rest
                                     if rest > 0 else "")


def _fit_of(series: Series) -> List[Line]:
    """Return the change as it was fitted."""
    change = series.change
    if change is None:
        return []
    first, last = series.number[0] + 1.0, series.number[-1] + 1.0
    corner = series.number[change.first] + (0.0 if change.is_gradual else 1.0)
    after = change.before + change.size
    x = [first, corner, last] if change.is_gradual else [first, corner, corner, last]
    y = [change.before, change.before, after] if change.is_gradual else [change.before, change.before, after, after]
    return [Line("fit", np.array(x), np.array(y))]


def _series_figure(series: Series, runs: Sequence[RunOutcome]) -> Figure:
    factor, unit = (1000.0, "mrad") if series.unit == "rad" else (1.0, series.unit)
    lines = [Line("candidate", series.number + 1.0, series.value), *_fit_of(series)]
    typical = float(np.median(series.value)) if len(series.value) else 0.0
    top = max(2.0 * series.limit, 4.0 * typical) if series.is_joint else np.inf
    scaled = [Line(line.style, line.x, np.minimum(line.y, top) * factor) for line in lines]
    first = series.first_changed
    cell = _cell_title(series.cell)
    return Figure("%s, %s from run to run" % (cell, series.name), chart(
        "%s, %s" % (cell, series.name), "The amount over the runs, with the change that was found.", scaled,
        _run_axis(runs), unit, 150, None if first is None else first + 1.0,
        (0.0, series.limit * factor) if series.is_joint else None, least=0.01 * typical * factor, x_unit="run"))


def _drifts(history: RunHistory) -> str:
    legend = '<p class="legend"><span style="--k:var(--candidate)">measured</span>' \
             '<span class="fit">as fitted</span>%s%s</p>' % (_BAND, _MARK)
    cards = "".join('<article class="card bad"><h3>%s</h3><p>%s</p>%s</article>' % (
        escape(drift_title(series)), escape(drift_words(series, history.runs_of(series.cell))),
        figures_of([_series_figure(series, history.runs_of(series.cell))])) for series in history.drifts[:_MOST_DRIFTS])
    rest = len(history.drifts) - _MOST_DRIFTS
    return legend + cards + ("<p>%d more are in the table of trends.</p>" % rest if rest > 0 else "")


def _more(count: int, most: int, what: str) -> str:
    """Return the words about what is left out of so many; "" where nothing is."""
    return "<p>%d more %s are in the tables.</p>" % (count - most, what) if count > most else ""


_STYLES = {SAME: "same", DIFFERENT: "different"}


def _run_bars(history: RunHistory) -> str:
    """Draw the runs of each cell on a time line, in days since the first one."""
    runs = [run for run in history.runs if run.start_ns > 0]
    if not runs:
        return ""
    start = runs[0].start_ns
    until = max((run.start_ns - start) / _DAY_NS + run.duration / 86400.0 for run in runs)
    rows = [Row(_cell_title(cell.name)[-26:], [
        Bar((run.start_ns - start) / _DAY_NS, (run.start_ns - start) / _DAY_NS + run.duration / 86400.0,
            "run " + _STYLES.get(run.verdict, "left"), "",
            "%s %s, %s: %s%s" % (day(run.start_ns), os.path.basename(run.path), run.verdict, run.worst or run.reason,
                                 "" if run.margin is None else ", %.3g" % run.margin))
        for run in cell.runs if run.start_ns > 0][-_MOST_BARS:]) for cell in history.cells[:_MOST_ROWS]]
    legend = ('<p class="legend"><span class="box" style="--k:var(--good)">same</span>'
              '<span class="box" style="--k:var(--bad)">different</span>'
              '<span class="box" style="--k:var(--faint)">not compared</span></p>')
    hidden = sum(max(0, sum(run.start_ns > 0 for run in cell.runs) - _MOST_BARS) for cell in history.cells[:_MOST_ROWS])
    return legend + figures_of([Figure("Days since %s, UTC" % day(start), time_line(
        "Runs over time", "A row for each cell, a bar for each run; its colour is the verdict.", rows,
        (0.0, max(until, 1e-4))))]) + _more(len(history.cells), _MOST_ROWS, "cells") + _more(hidden, 0, "earlier runs")


def _table(heads: Sequence[str], rows: Iterable[str]) -> str:
    return '<div class="scroll"><table><thead><tr>%s</tr></thead><tbody>%s</tbody></table></div>' % (
        "".join('<th scope="col">%s</th>' % head for head in heads), "".join(rows))


def _trend_row(series: Series, history: RunHistory) -> str:
    runs = history.runs_of(series.cell)
    first = series.first_changed
    left = series.runs_left
    level = shown(float(np.median(series.value[-max(len(series.value) // 10, 1):])), series.unit) \
        if len(series.value) else ""
    future = "beyond since run %d" % (series.first_beyond + 1) if series.first_beyond is not None else \
        "in %.0f to %.0f runs" % left if left is not None else ""
    slope = "" if series.slope is None else shown_slope(series.slope, series.unit, series.limit)
    sure = series.slope is not None and series.slope.is_sure
    return ('<tr class="%s"><td>%s</td><th scope="row">%s</th><td class="number">%s</td><td class="number">%s</td>'
            '<td>%s</td><td>%s</td><td>%s</td></tr>' % (
                "drift" if series.change is not None else "", escape(series.cell), escape(series.name), escape(level),
                escape(shown(series.limit, series.unit)) if series.is_joint else "", escape(slope),
                "yes" if sure else "no", escape("" if first is None else run_words(first, runs))
                + ("<br>limit: %s" % escape(future) if future else "")))


def _trends(history: RunHistory) -> str:
    series = [one for cell in history.cells for one in cell.series]
    series.sort(key=lambda one: one.change is None)
    rows = [_trend_row(one, history) for one in series[:_MOST_ROWS]]
    return ("<p>Slopes over all runs by Theil and Sen, with 95 %% confidence; the amount of a joint is its largest "
            "difference from the golden log.</p>%s%s" % (
                _table(("cell", "what", "now", "limit", "trend", "is sure", "drifts since"), rows),
                _more(len(series), _MOST_ROWS, "amounts")))


def _margin(value: Optional[float]) -> str:
    return "" if value is None else "no amount" if math.isinf(value) else "%.2f" % value


def _worst(history: RunHistory, reports: Mapping[str, str]) -> str:
    rows = []
    for run in worst_first(history.runs)[:WORST]:
        name = escape(os.path.basename(run.path))
        link = reports.get(run.key)
        rows.append('<tr><th scope="row">%s</th><td>%s</td><td>%s</td><td class="number">%s</td><td>%s</td><td>%s</td>'
                    "</tr>" % ('<a href="%s">%s</a>' % (escape(link), name) if link else name, escape(run.cell),
                               day(run.start_ns), _margin(run.margin), escape(run.worst), escape(run.reason)))
    return _table(("run and its report", "cell", "UTC", "of the limit", "worst check", "what differs"), rows)


def _checks(history: RunHistory) -> str:
    """Render the table of the checks that failed: how often, and where."""
    found: Dict[str, List[RunOutcome]] = {}
    for run in history.runs:
        for check in run.checks:
            if check.outcome == DIFFERENT:
                found.setdefault(check.name, []).append(run)
    rows = ['<tr><th scope="row">%s</th><td class="number">%d</td><td>%s</td><td>%s, %s</td></tr>' % (
        escape(name), len({run.key for run in runs}), escape(", ".join(sorted({run.cell for run in runs}))),
        day(runs[0].start_ns), escape(os.path.basename(runs[0].path)))
        for name, runs in sorted(found.items(), key=lambda item: (-len(item[1]), item[0]))[:_MOST_ROWS]]
    return _table(("check", "runs", "cells", "first"), rows) + _more(len(found), _MOST_ROWS, "checks") if rows else ""


def _left(history: RunHistory) -> str:
    left = [run for run in history.runs if run.verdict not in (SAME, DIFFERENT)]
    rows = ['<tr><th scope="row">%s</th><td>%s</td><td class="outcome not-compared">%s</td><td>%s</td></tr>' % (
        escape(run.path), escape(run.cell), escape(run.verdict), escape(run.reason)) for run in left[:_MOST_ROWS]]
    return _table(("log", "cell", "outcome", "why"), rows) + _more(len(left), _MOST_ROWS, "logs") if rows else ""


def as_page(history: RunHistory, setup: Setup, against: str, reports: Mapping[str, str]) -> str:
    """Return the page, to be written as UTF-8.

    Args:
        history: All runs.
        setup: Conditions of their comparison.
        against: Their place, for people.
        reports: Links to the reports of single runs, by ``RunOutcome.key``.
    """
    bad = history.count(SAME) != len(history.runs)
    kind = "different" if bad else "drift" if history.drifts else "same"
    title = "%d of %d runs are different" % (history.count(DIFFERENT), len(history.runs)) \
        if history.count(DIFFERENT) else "%d runs, none is different" % len(history.runs)
    dated = [run.start_ns for run in history.runs if run.start_ns > 0]
    facts = [("golden log", setup.golden), ("runs", "%s, %d cells" % (against, len(history.cells)))]
    if dated:
        facts.append(("time", "%s to %s UTC" % (day(min(dated)), day(max(dated)))))
    facts += [("drift", "%s %s" % (drift_title(series), drift_words(series, history.runs_of(series.cell))))
              for series in history.drifts[:3]] or [("drift", "none found")]
    sections = [section for section in (
        Section("drifts", "What drifts, the largest first", _drifts(history) if history.drifts else ""),
        Section("runs", "Runs over time", '<div class="card">%s</div>' % _run_bars(history)),
        Section("margins", "Margins", '<div class="card">%s</div>' % _margins(history)),
        Section("trends", "Trends", '<div class="card">%s</div>' % _trends(history)),
        Section("worst", "The worst runs", _carded(_worst(history, reports) if history.count(DIFFERENT) else "")),
        Section("checks", "Which checks failed", _carded(_checks(history))),
        Section("left", "Not compared", _carded(_left(history))),
        Section("tolerances", "Tolerances", '<div class="card"><details><summary>The tolerances as a YAML file'
                "</summary><pre>%s</pre></details></div>" % escape(as_yaml(setup.tolerances)))) if section.body]
    links = "".join('<li><a href="#%s">%s</a></li>' % (section.name, section.heading) for section in sections)
    body = "".join('<section id="%s"><h2>%s</h2>%s</section>' % section for section in sections)
    return page(title, (
        '<a class="skip" href="#trends">To the trends</a><main><header class="verdict %s"><h1>%s</h1><p>%s</p></header>'
        '<nav aria-label="Sections"><ul>%s</ul></nav><div class="card">%s</div>%s</main>'
        % (kind, escape(title), escape(history.headline), links, definitions(facts), body)), _MORE_STYLE)


def _carded(content: str) -> str:
    return '<div class="card">%s</div>' % content if content else ""
