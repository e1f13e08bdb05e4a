"""The report of a probe as one page: no script, nothing from elsewhere, every text escaped."""
import html
from typing import Any, Iterator, List, Mapping, Sequence, Tuple

from jaka_ros_driver.probe.facts import DESCRIBED, Facts
from jaka_ros_driver.probe.fields import TABLES
from jaka_ros_driver.probe.report import differences, firmware_of, words
from jaka_ros_driver.probe.statements import STATEMENTS, Verdict, verdicts
from jaka_ros_driver.probe.twin import RETURN

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #1a1a1a; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #bbb; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .3em .8em .3em 0; border-bottom: 1px solid #ddd; }
td { overflow-wrap: break-word; min-width: 5em; } .how { color: #555; font-size: .9em; }
.warn { background: #fdecea; border-left: .3em solid #b3261e; padding: .6em 1em; }
svg { max-width: 100%; height: auto; }
"""
_WIDTH, _HEIGHT, _MARGIN, _APART = 640, 240, 44, 60
_TITLES = {"move": "Joint 6 in a move of 2 deg, from its first motion on",
           "out": "Joint 6 in a move of 2.5 deg that accelerates slowly; 0 s is its acceptance",
           "back": "The same on its way back, with which the simulated controller is compared",
           "stop": "Joint 6 in a move that is stopped; 0 s is when stop_program was sent"}


def page(content: Mapping[str, Any], facts: Facts) -> str:
    """Return the page of a probe.json's content, whose facts these are."""
    return "\n".join([
        "<!DOCTYPE html>", '<html lang="en"><head><meta charset="utf-8">',
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; style-src \'unsafe-inline\'">',
        '<meta name="viewport" content="width=device-width">', "<title>jaka_probe</title>",
        "<style>%s</style></head><body>" % _STYLE, *_body(content, facts), "</body></html>", ""])


def _body(content: Mapping[str, Any], facts: Facts) -> Iterator[str]:
    yield "<h1>What this controller was found to do</h1>"
    yield "<p>%s; stages: %s%s.</p>" % (_text(content["made_by"]), _text(words(content["stages"])),
                                       "" if content["is_whole"] else "; <b>it was ended before its time, or a "
                                       "stage could not run</b>")
    if content["not_set_back"]:
        yield '<h2>Not set back</h2><ul class="warn">%s</ul>' % "".join(
            "<li>%s</li>" % _text(line) for line in content["not_set_back"])
    settled = [name for name in DESCRIBED if name in facts and facts[name].value is not None]
    judged = verdicts(facts)
    rows = _statement_rows(facts, [number for number in STATEMENTS if judged[number] is Verdict.CONTRADICTED])
    yield "<h2>Contradicts the documents</h2>"
    yield _table(("the documents say", "found", ""), rows) if rows else "<p>Nothing that was looked for.</p>"
    firmware = firmware_of(facts)
    if firmware:
        lines = differences(facts, firmware)
        yield "<h2>Otherwise than the simulated controller of firmware %s</h2>" % _text(firmware)
        yield "<ul>%s</ul>" % "".join("<li>%s</li>" % _text(line.strip()) for line in lines) if lines else (
            "<p>Nothing that was looked for.</p>")
    for name, points in content["curves"].items():
        if not name.startswith(RETURN):  # these are many and alike
            yield "<h2>%s</h2>%s" % (_text(_TITLES.get(name, name)), curve(points))
    yield "<h2>Settled</h2>"
    yield _table(("what", "found", "how"), [
        (DESCRIBED[name].meaning, _value(facts, name), "; ".join(filter(None, [facts[name].how, facts[name].spread])))
        for name in settled if name not in TABLES])
    yield "<h2>Not settled</h2>"
    yield _table(("what", "why"), [(DESCRIBED[name].meaning, facts[name].how)
                                   for name in DESCRIBED if name in facts and name not in settled])
    yield "<h2>Confirms the documents</h2>"
    yield _table(("the documents say", "found", ""), _statement_rows(
        facts, [number for number in STATEMENTS if judged[number] is Verdict.CONFIRMED]))
    yield "<h2>Statements of the documents that were not seen</h2>"
    yield _table(("the documents say",), [
        (_statement(number),) for number in STATEMENTS if judged[number] is Verdict.NOT_SEEN])
    for name in [name for name in TABLES if name in settled]:
        described, fact = DESCRIBED[name].meaning, facts[name]
        yield "<h2>%s</h2><p>%s</p>" % (_text(described[0].upper() + described[1:]), _text(fact.how))
        yield _table(*_rows_of_table(name, fact.value))


def _rows_of_table(name: str, value: Mapping[str, Any]) -> Tuple[Sequence[str], List[Sequence[str]]]:
    """Return head and rows of a fact that is a table."""
    if name == "reply_types":
        return ("command", "key", "type"), [
            (command, key, kind) for command, keys in value.items() for key, kind in keys.items()]
    return ("field", "type", "from", "to"), [
        (field, kind, *("" if one is None else "%g" % one for one in ends)) for field, (kind, *ends) in value.items()]


def _statement(number: str) -> str:
    one = STATEMENTS[number]
    return "%s, section %s [%s]: %s" % (number, one.section, one.tag, one.says)


def _statement_rows(facts: Facts, numbers: Sequence[str]) -> List[Sequence[str]]:
    return [(_statement(number), "; ".join(_value(facts, name) for name in STATEMENTS[number].facts),
             facts[STATEMENTS[number].facts[-1]].how) for number in numbers]


def _value(facts: Facts, name: str) -> str:
    return " ".join(filter(None, [words(facts[name].value), DESCRIBED[name].unit]))


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = ["<tr>%s</tr>" % "".join("<th>%s</th>" % _text(cell) for cell in head)]
    for row in rows:
        cells.append("<tr>%s</tr>" % "".join('<td%s>%s</td>' % (' class="how"' if place == 2 else "", _text(cell))
                                             for place, cell in enumerate(row)))
    return "<table>%s</table>" % "".join(cells)


def curve(points: Sequence[Sequence[float]]) -> str:
    """Return a drawing of points (s, deg); "" where there are fewer than two."""
    if len(points) < 2:
        return ""
    times, places = [float(at) for at, _ in points], [float(place) for _, place in points]
    first, last, low, high = min(times), max(times), min(places), max(places)

    def across(at: float) -> float:
        return _MARGIN + (at - first) / ((last - first) or 1.0) * (_WIDTH - 2 * _MARGIN)

    def down(place: float) -> float:
        return _HEIGHT - _MARGIN - (place - low) / ((high - low) or 1.0) * (_HEIGHT - 2 * _MARGIN)
    drawn = ['<svg viewBox="0 0 %d %d" width="%d" role="img" aria-label="%d points from %.2f to %.2f deg">' % (
        _WIDTH, _HEIGHT, _WIDTH, len(points), low, high)]
    zero = [0.0] if first <= 0.0 <= last else []
    for at in [*zero, *(at for at in (first, last) if all(abs(across(at) - across(0.0)) >= _APART for _ in zero))]:
        x, bottom = across(at), _HEIGHT - _MARGIN
        drawn.append('<line x1="%.1f" x2="%.1f" y1="%d" y2="%d" stroke="#ccc"/>' % (x, x, _MARGIN, bottom))
        drawn.append('<text x="%.1f" y="%d" font-size="12" text-anchor="middle">%.2f s</text>' % (x, bottom + 18, at))
    for place in (low, high):
        drawn.append('<text x="%d" y="%.1f" font-size="12" text-anchor="end">%.2f&deg;</text>' % (
            _MARGIN - 4, down(place) + 4, place))
    drawn.append('<polyline fill="none" stroke="#0b57d0" stroke-width="1.5" points="%s"/>' % " ".join(
        "%.1f,%.1f" % (across(at), down(place)) for at, place in zip(times, places)))
    return "".join([*drawn, "</svg>"])


def _text(value: Any) -> str:
    return html.escape(str(value))
