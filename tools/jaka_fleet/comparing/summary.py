"""Many runs against one golden log as a few lines of text, and as plain data."""
import math
import os
import time
from typing import Any, Dict, List, Optional

from jaka_bag.units import NS_PER_S

from .history import RunHistory, Series
from .outcome import NOT_COMPARED, RunOutcome, worst_first
from .store import Setup, finite
from .trend import Slope

WORST = 10
"""Number of runs in the list of the worst ones: a person opens some."""
_SHOWN_DRIFTS = 8
"""Drifts in the summary of a terminal."""
_HUNDRED = 100.0


def shown(value: float, unit: str) -> str:
    """Format an amount for people: angles in mrad."""
    return "%.3g mrad" % (1000.0 * value) if unit == "rad" else "%.4g %s" % (value, unit)


def shown_slope(slope: Slope, unit: str, limit: float) -> str:
    """Format a slope and its interval, for each hundred runs; in thousandths of a limit, or little finer."""
    places = min(max(int(math.ceil(3.0 - math.log10(max(1000.0 * limit, 1e-9)))), 0), 12)
    value, low, high = ("%+.*f" % (places, round(_HUNDRED * 1000.0 * edge, places) + 0.0)  # never -0
                        for edge in slope)
    return "%s m%s in 100 runs (%s to %s)" % (value, unit, low, high)


def day(at_ns: int) -> str:
    """Format day and time of day, UTC."""
    return time.strftime("%Y-%m-%d %H:%M", time.gmtime(at_ns // NS_PER_S))


def run_words(number: int, runs: List[RunOutcome]) -> str:
    """Describe a run of a cell: its number, from 1, its time and its file."""
    run = runs[number]
    return "run %d of %d (%s, %s)" % (number + 1, len(runs), day(run.start_ns), os.path.basename(run.path))


def drift_title(series: Series) -> str:
    """Describe in a few words what drifts where."""
    assert series.change is not None
    verb = "drifts" if series.change.is_gradual else "has jumped"
    return "%s%s %s" % (series.cell + ": " if series.cell else "", series.name, verb)


def drift_words(series: Series, runs: List[RunOutcome]) -> str:
    """Describe since when a series drifts, by how much, and when the limit is reached."""
    change, first = series.change, series.first_changed
    assert change is not None and first is not None
    parts = ["since %s" % run_words(first, runs),
             "by %s so far" % shown(change.size, series.unit)]
    rise, left = series.rise, series.runs_left
    if rise is not None:
        parts.append(shown_slope(rise, series.unit, series.limit))
    if series.first_beyond is not None:
        parts.append("beyond its limit of %s since run %d" % (shown(series.limit, series.unit),
                                                             series.first_beyond + 1))
    elif left is not None:
        parts.append("if it goes on so, its limit of %s is reached in %.0f to %.0f runs"
                     % (shown(series.limit, series.unit), *left))
    return "; ".join(parts)


def as_text(history: RunHistory, setup: Setup, verbose: bool = False) -> str:
    """Return the verdicts, what drifts since when, the worst runs, and those that were not compared."""
    lines = ["golden: %s" % setup.golden]
    for run in history.runs if verbose else worst_first(history.runs)[:WORST]:
        lines.append("%-13s %s%s%s" % (run.verdict.upper(), run.path, _margin_words(run.margin),
                                       ": " + run.reason if run.reason else ""))
    if not verbose:
        lines += ["%-13s %s: %s" % (run.verdict.upper(), run.path, run.reason)
                  for run in history.runs if run.verdict == NOT_COMPARED][:WORST]
    lines += ["DRIFT         %s %s" % (drift_title(series), drift_words(series, history.runs_of(series.cell)))
              for series in history.drifts[:None if verbose else _SHOWN_DRIFTS]]
    return "\n".join([*lines, history.headline])


def _margin_words(margin: Optional[float]) -> str:
    return "" if margin is None or finite(margin) is None else " (%.2f of a limit)" % margin


def as_data(history: RunHistory, setup: Setup) -> Dict[str, Any]:
    """Return the history as plain data, for JSON; each run's checks are in the tables."""
    return {"format": 1, "summary": history.headline, **setup.facts(),
            "runs": [{"run": run.run, "path": run.path, "cell": run.cell, "start_ns": run.start_ns,
                      "verdict": run.verdict, "reason": run.reason, "margin": finite(run.margin), "worst": run.worst,
                      "cycle_s": run.cycle} for run in history.runs],
            "trends": [{"cell": series.cell, "name": series.name, "topic": series.topic, "unit": series.unit,
                        "limit": series.limit, "runs": len(series.number),
                        "slope_per_run": None if series.slope is None else list(series.slope),
                        "drifts": series.change is not None, "since_run": _counted(series.first_changed),
                        "beyond_since_run": _counted(series.first_beyond)}
                       for cell in history.cells for series in cell.series]}


def _counted(number: Optional[int]) -> Optional[int]:
    """Return the number of a run as people read it, counted from 1."""
    return None if number is None else number + 1
