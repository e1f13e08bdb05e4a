"""The HTML page about an accident, which needs no network and no scripts."""
import os
import time
from html import escape
from typing import Callable, List, Sequence, Tuple, TypeVar

import numpy as np

from jaka_bag.compare.checks.state_checks import state_name
from jaka_bag.compare.report.html import body_of, contents_of, definitions, figures_of, page
from jaka_bag.compare.report.pictures import Figure
from jaka_bag.compare.report.svg import Bar, Line, Row, bounded_row, chart, plane, time_line
from jaka_bag.messages.batch import Array
from jaka_bag.operations.plot import thin
from jaka_bag.units import NS_PER_S

from .loading import Incident, Motion, Silence
from .seconds import AT_REST, Second, seconds_of

_Item = TypeVar("_Item")
_POINTS = 1100
"""Points of a curve: about one for each pixel of its width."""
_PATH_POINTS = 3000
"""Points of the tool's path, which has no width of pixels: corners stay sharp, and the page small."""
_MOST_ROWS = 2000
"""Rows of a table: a browser shows so many at once; the rest is counted."""
_MOST_TRIGGERS = 20
"""Triggers in the headline; all are in their seconds below."""
_LOSSES = (("missing", "missing by header.seq"), ("undelivered", "sent but not received"),
           ("overflowed", "thrown away, the recorder's memory was full"), ("unwritten", "not written"))
_MORE_STYLE = """
.at{white-space:nowrap;text-align:right;font-variant-numeric:tabular-nums}
tr.trigger td,tr.trigger th{background:var(--bad-soft)}
.event{margin:0}.event.trigger,.event.failed,.event.fault{color:var(--bad);font-weight:600}
.event time{display:inline-block;min-width:5.2em;color:var(--faint);font-weight:400;font-variant-numeric:tabular-nums}
tr.quiet td{color:var(--faint)}
"""


def _moment(at_ns: int) -> str:
    seconds, rest = divmod(at_ns, NS_PER_S)
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds)) + ".%03d" % (rest // 10**6) + time.strftime(
        " %z", time.localtime(seconds))


def _breaks(incident: Incident, topic: str) -> Array:
    """Return a time within each silence of a topic, s (k,): no line is led over it."""
    return np.array([0.5 * (one.start + one.end) for one in incident.silences if one.topic == topic], float)


def _curve(time_s: Array, value: Array, breaks: Array) -> Line:
    """Return the line through the values, interrupted at ``breaks``, s (k,), and where there are no numbers."""
    good = np.isfinite(value)
    lacking = np.flatnonzero(~good)
    breaks = np.concatenate([breaks, time_s[lacking[np.diff(lacking, prepend=-2) > 1]]])
    breaks.sort()
    thinned, values = thin(time_s[good], value[good], _POINTS)
    places = np.searchsorted(thinned, breaks)
    return Line("candidate", np.insert(thinned, places, breaks), np.insert(values, places, np.nan))


def _motion_figures(incident: Incident) -> List[Figure]:
    """Return figures of each joint's position and speed."""
    figures = []
    for topic, motion in incident.joints.items():
        breaks = _breaks(incident, topic)
        for column, name in enumerate(motion.names):
            for what, unit, values in (("position", "rad", motion.value), ("speed", "rad/s", motion.velocity)):
                figures.append(Figure("%s, %s of %s" % (name, what, topic), chart(
                    "%s %s" % (name, what), "Over time; the trigger is marked.",
                    [_curve(motion.time, values[:, column], breaks)], incident.span, unit, 110, 0.0, least=0.02)))
    return figures


def _plane_line(pose: Motion, breaks: Array, one: int, other: int) -> Line:
    step = max(1, len(pose.time) // _PATH_POINTS)
    points = np.insert(pose.value[::step], np.searchsorted(pose.time[::step], breaks), np.nan, axis=0)
    return Line("candidate", points[:, one], points[:, other])


def _path_figures(incident: Incident) -> List[Figure]:
    """Return figures of each tool point's path, with the place at the trigger marked, its coordinates and its speed."""
    figures = []
    for topic, pose in incident.poses.items():
        if not len(pose.time):
            continue
        breaks = _breaks(incident, topic)
        here = pose.value[max(int(np.searchsorted(pose.time, 0.0)) - 1, 0)]
        planes = "".join(plane("Path in the plane of %s and %s" % ("xyz"[one], "xyz"[other]),
                               "Path of the tool centre point; a circle marks where it was at the trigger.",
                               [_plane_line(pose, breaks, one, other)], ("xyz"[one] + ", m", "xyz"[other] + ", m"),
                               (float(here[one]), float(here[other]))) for one, other in ((0, 1), (0, 2), (1, 2)))
        figures.append(Figure("Path of %s" % topic, '<div class="planes">%s</div>' % planes))
        figures.append(Figure("Speed of %s" % topic, chart(
            "Tool speed", "Over time; the trigger is marked.", [_curve(pose.time, pose.speed, breaks)],
            incident.span, "m/s", 130, 0.0, least=0.01)))
        figures += [Figure("%s of %s" % (name, topic), chart(
            name, "Over time; the trigger is marked.", [_curve(pose.time, pose.value[:, column], breaks)],
            incident.span, "m", 110, 0.0, least=0.005)) for column, name in enumerate(pose.names)]
    return figures


def _state_row(name: str, field: str, time_s: Array, value: Array, silences: Sequence[Silence], until: float) -> Row:
    """Return the row of a state: a bar for each value, and none where nothing came."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(value)) + 1]) if len(value) else np.zeros(0, np.int64)
    starts = time_s[begins].tolist()
    bars = []
    for number, start, end in zip(begins.tolist(), starts, starts[1:] + [until]):
        words = state_name(field, int(value[number]))
        within = [one for one in silences if start <= one.start < end]
        for since, to in zip([start, *[one.end for one in within]], [*[one.start for one in within], end]):
            if since < to or since == start:  # of one message, too
                bars.append(Bar(since, to, "state state%d" % (int(value[number]) % 6), words,
                                "%s %s from %.3f s to %.3f s" % (field, words, since, to)))
    return bounded_row(name, bars)


def _time_lines(incident: Incident) -> List[Figure]:
    """Return figures with a row for each state, call and diagnostics status."""
    rows, until = [], incident.span[1]
    for topic, fields in incident.states.items():
        arm = topic.rsplit("/", 2)[0].strip("/")
        silences = [one for one in incident.silences if one.topic == topic]
        rows += [_state_row("%s %s" % (arm, name) if arm else name, name, *values, silences, until)
                 for name, values in fields.items()]
    for service in sorted({call.service for call in incident.calls}):
        rows.append(bounded_row(service.strip("/").replace("jaka_driver/", ""), [
            Bar(call.at, call.at + call.duration, "call" if call.success else "call failed", "",
                "%s called by %s at %.3f s, %.3f s, %s" % (call.service, call.caller, call.at, call.duration,
                                                          "succeeded" if call.success else "failed: " + call.error))
            for call in incident.calls if call.service == service]))
    for name in sorted({change.name for change in incident.changes if change.level != "OK"}):
        changes = [change for change in incident.changes if change.name == name]
        ends = [change.at for change in changes[1:]] + [incident.ended.get(name, until)]
        rows.append(bounded_row(name.split(": ", 1)[-1], [
            Bar(change.at, end, "state state2" if change.level == "ERROR" else "state state5", change.level,
                "%s: %s, %s" % (name, change.level, change.message))
            for change, end in zip(changes, ends) if change.level != "OK"]))
    if not rows:
        return []
    return [Figure("The trigger is marked", time_line(
        "States, calls and diagnostics", "A row for each state, service and status that was not OK.", rows,
        incident.span, 0.0))]


def _table(heads: Sequence[str], items: Sequence[_Item], row: Callable[[_Item], str]) -> str:
    """Return a table with a row for each item; behind one of very many it says how many are left out."""
    rest = len(items) - _MOST_ROWS
    return ('<div class="scroll"><table><thead><tr>%s</tr></thead><tbody>%s</tbody></table></div>%s'
            % ("".join('<th scope="col">%s</th>' % head for head in heads), "".join(map(row, items[:_MOST_ROWS])),
               "<p>%d more rows are left out.</p>" % rest if rest > 0 else ""))


def _second_row(second: Second) -> str:
    words = "".join('<p class="event %s"><time>%+.3f s</time> %s</p>' % (event.sort, event.at, escape(event.words))
                    for event in second.events) or (
        "in motion" if not second.is_quiet else "nothing happened; no joint was faster than %g rad/s" % AT_REST
        if second.joint is not None else "nothing happened" if second.is_seen else "no joints, no tool point recorded")
    kind = "trigger" if any(event.sort == "trigger" for event in second.events) else "quiet" if second.is_quiet else ""
    joint = "" if second.joint is None else "%s %.3f" % (second.joint[0], second.joint[1])
    tool = "" if second.tool is None else "%.3f" % second.tool
    return ('<tr class="%s"><th scope="row" class="at">%+d&#8239;&#8230;&#8239;%+d</th><td>%s</td>'
            '<td class="number">%s</td><td class="number">%s</td></tr>'
            % (kind, second.start, second.end, words, escape(joint), tool))


def _seconds(incident: Incident) -> str:
    return _table(("s from the trigger", "what happened", "fastest joint, rad/s", "tool, m/s"), seconds_of(incident),
                  _second_row)


def _calls(incident: Incident) -> str:
    if not incident.calls:
        return ""
    return _table(("s", "service", "caller", "request", "outcome", "duration, s"), incident.calls, lambda call: (
        '<tr><td class="at">%+.3f</td><td>%s</td><td>%s</td><td>%s</td><td class="outcome %s">%s</td>'
        '<td class="number">%.3f</td></tr>'
        % (call.at, escape(call.service), escape(call.caller), escape(" ".join(call.request.split())),
           "same" if call.success else "different", "succeeded" if call.success else escape("failed: " + call.error),
           call.duration)))


def _changes(incident: Incident) -> str:
    if not incident.changes:
        return ""
    return _table(("s", "status", "from", "to", "message"), incident.changes, lambda change: (
        '<tr><td class="at">%+.3f</td><td>%s</td><td>%s</td><td class="outcome %s">%s</td><td>%s</td></tr>'
        % (change.at, escape(change.name), escape(change.before or "first seen"),
           "same" if change.level == "OK" else "different", escape(change.level), escape(change.message))))


def _losses(incident: Incident) -> str:
    rows = []
    for topic, count in incident.counts.items():
        account = incident.drops.get(topic)
        lost = ["%s %s" % (account[key], words) for key, words in _LOSSES if account.get(key)] if account else []
        words = ", ".join(lost) if lost else "nothing" if account is not None else "the recorder left no account"
        rows.append('<tr><th scope="row">%s</th><td class="number">%d</td><td class="outcome %s">%s</td></tr>'
                    % (escape(topic), count, "different" if lost else "same", escape(words)))
    silences = "".join("<p>Nothing came on %s from %+.3f s to %+.3f s.</p>" % (escape(one.topic), one.start, one.end)
                       for one in incident.silences)
    gaps = "".join("<p>%s.</p>" % escape(one) for one in incident.gaps)
    return _table(("topic", "messages", "lost"), rows, str) + silences + gaps


def incident_page(incident: Incident) -> str:
    """Return the HTML page, to be written as UTF-8."""
    first = incident.triggers[0] if incident.triggers else None
    name = os.path.basename(incident.path)
    headline = "%s: %s" % (first.kind.replace("_", " "), first.detail) if first is not None else "what happened"
    where = [("trigger", "%s (%s)" % (headline, first.topic or "no topic") if first is not None else "none"),
             ("time", "%s, %d.%09d s since the epoch" % (
                 _moment(incident.at_ns), *divmod(incident.at_ns, NS_PER_S))),
             ("log", "%s, from %+.1f s to %+.1f s" % (incident.path, *incident.span))]
    where += [("further trigger", "%+.3f s, %s: %s" % (one.at, one.kind, one.detail))
              for one in incident.triggers[1:_MOST_TRIGGERS]]
    if len(incident.triggers) > _MOST_TRIGGERS:
        where.append(("more triggers", "%d, in their seconds below" % (len(incident.triggers) - _MOST_TRIGGERS)))
    facts = definitions(sorted(incident.facts.items()))
    attachments = definitions([(item, "%d byte" % size) for item, size in incident.attachments])
    sections: List[Tuple[str, str, str]] = [
        (key, heading, '<div class="card">%s</div>' % text) for key, heading, text in (
        ("seconds", "Second by second", _seconds(incident)),
        ("timeline", "States, calls and diagnostics", figures_of(_time_lines(incident))),
        ("path", "Tool centre point", figures_of(_path_figures(incident))),
        ("joints", "Joints", figures_of(_motion_figures(incident))),
        ("calls", "Service calls", _calls(incident)),
        ("diagnostics", "Changes of diagnostics", _changes(incident)),
        ("losses", "What was lost", _losses(incident)),
        ("recording", "The recording", facts),
        ("attachments", "Attached to the log", attachments)) if text and text != "<dl></dl>"]
    return page("%s: %s" % (name, headline), (
        '<a class="skip" href="#seconds">To the seconds</a>'
        '<main><header class="verdict different"><h1>%s</h1><p>%s</p></header>'
        '%s<div class="card">%s</div>%s</main>'
        % (escape(headline), escape(_moment(incident.at_ns)), contents_of(sections), definitions(where),
           body_of(sections))), _MORE_STYLE)
