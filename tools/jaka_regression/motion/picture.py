"""A plan beside what was recorded: a page that needs nothing else, or a picture by matplotlib."""
from html import escape
from pathlib import Path
from typing import Iterator, List, Tuple

import numpy as np

from jaka_bag.compare.report.html import definitions, figures_of, page
from jaka_bag.compare.report.pictures import Figure
from jaka_bag.compare.report.svg import Line, chart
from jaka_bag.errors import BagError
from jaka_bag.messages.batch import Array
from jaka_bag.operations.plot import FORMATS, Panel, draw, thin
from jaka_bag.output_file import OutputFile, check_output
from jaka_bag.paths import PathLike

from .plan import MotionPlan

PAGE = ".html"
_POINTS = 1100
"""Points of a curve: about one for each pixel of its width."""
_LEGEND = """<p class="legend"><span class="golden" style="--k:var(--golden)">recorded, at the speed asked for</span>
<span class="candidate" style="--k:var(--candidate)">to be sent</span></p>"""


def check_picture(target: PathLike, overwrite: bool) -> None:
    """Refuse a picture that could not be made, before any work is done for it.

    Raises:
        BagError: Its suffix is none of .html, .svg and .png, or it cannot be created there.
        OutputExists: It is there already.
    """
    if Path(target).suffix not in (PAGE, *FORMATS):
        raise BagError("%s: the name of a picture ends in one of %s" % (target, ", ".join((PAGE, *FORMATS))))
    check_output(target, overwrite)


def draw_plan(plan: MotionPlan, target: PathLike, overwrite: bool = False) -> None:
    """Draw each joint as recorded and as it is to be sent, and how much of its limits the arm needs.

    Raises:
        BagError: The picture cannot be created.
        MissingDependency: It is .svg or .png, and matplotlib is not installed.
    """
    title = "motion of %s" % Path(plan.recording.path).name
    if Path(target).suffix != PAGE:
        draw([Panel(name, unit, tuple((label, time, value) for label, _, time, value in curves))
              for name, unit, curves in _diagrams(plan)], target, title, {}, overwrite)
        return
    with OutputFile(target, overwrite) as output:
        output.write(_as_page(plan, title).encode("utf-8"))


def _diagrams(plan: MotionPlan) -> Iterator[Tuple[str, str, List[Tuple[str, str, Array, Array]]]]:
    """Iterate over the diagrams: title, unit, and curves (label, style, time in s, values) of each."""
    recorded_at = plan.smoothed.path.step * np.arange(len(plan.smoothed.recorded)) / plan.factor
    for joint, name in enumerate(plan.recording.names):
        yield name, "rad", [
            ("recorded", "golden", *thin(recorded_at, plan.smoothed.recorded[:, joint], _POINTS)),
            ("to be sent", "candidate", *thin(plan.time, plan.position[:, joint], _POINTS))]
    for name, values, limits in (("speed", plan.velocity, plan.limits.speed),
                                 ("acceleration", plan.acceleration, plan.limits.acceleration)):
        share = 100.0 * (np.abs(values) / limits).max(axis=1)
        yield "%s, of what the joint that needs most of it has" % name, "%", [
            ("to be sent", "candidate", *thin(plan.time, share, _POINTS))]


def _as_page(plan: MotionPlan, title: str) -> str:
    span = 0.0, max(plan.duration, plan.smoothed.path.duration / plan.factor)
    figures = [Figure(name, chart(name, "The recorded joint and the one that is to be sent, over time.",
                                  [Line(style, time, value) for _, style, time, value in curves], span, unit,
                                  least=0.02))
               for name, unit, curves in _diagrams(plan)]
    facts = [("log", "%s, %s" % (plan.recording.path, plan.recording.topic)), ("arm", plan.limits.model),
             ("lasts", "%.2f s, %d points; as recorded %.2f s" % (
                 plan.duration, len(plan.time), plan.smoothed.path.duration)),
             ("speed", "%g times as recorded, by %s" % (plan.factor, plan.solver)),
             ("deviation", "at most %.2f mrad from the samples, whose noise is %.3f mrad" % (
                 1e3 * plan.smoothed.deviation, 1e3 * plan.smoothed.noise)),
             ("begins at", ", ".join("%.4f" % value for value in plan.start) + " rad")]
    facts += [("note", note) for note in plan.notes]
    return page(title, '<main><header class="verdict same"><h1>%s</h1><p>Nothing has been sent.</p></header>'
                       '<div class="card">%s</div>%s<div class="card">%s</div></main>' % (
                           escape(title), definitions(facts), _LEGEND, figures_of(figures)))
