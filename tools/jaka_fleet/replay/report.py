"""All replays of a driver as a page, as JUnit XML, as text and as plain data."""
import re
from html import escape
from typing import Any, Dict, List, NamedTuple, Optional, Sequence
from xml.etree import ElementTree

from jaka_bag.compare.report.html import definitions, page

from .replay_task import ReplayOutcome

_SUITE = "jaka_bag.replay"
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Replayed(NamedTuple):
    """One golden log.

    Attributes:
        name: Of its folder among the reports.
        path: The log.
        outcome: None where it could not be replayed.
        reason: Why not.
        seconds: Wall time on the worker, s.
    """

    name: str
    path: str
    outcome: Optional[ReplayOutcome]
    reason: str = ""
    seconds: float = 0.0

    @property
    def verdict(self) -> str:
        """In a word or two."""
        return "not replayed" if self.outcome is None else "same" if self.outcome.same else "different"

    @property
    def words(self) -> str:
        """What to know of it."""
        return self.reason if self.outcome is None else self.outcome.headline


def headline(replays: Sequence[Replayed], driver: str) -> str:
    """How many are what."""
    counts = {verdict: sum(one.verdict == verdict for one in replays)
              for verdict in ("same", "different", "not replayed")}
    return "%s, %d golden logs: %s" % (driver, len(replays), ", ".join(
        "%d %s" % (count, verdict) for verdict, count in counts.items()))


def as_text(replays: Sequence[Replayed], driver: str) -> str:
    """A line for each log, and the headline."""
    lines = ["%-13s %s: %s" % (one.verdict.upper(), one.path, one.words) for one in replays]
    return "\n".join([*lines, headline(replays, driver)])


def as_data(replays: Sequence[Replayed], driver: str) -> Dict[str, Any]:
    """All of it as plain data, for JSON."""
    return {"format": 1, "driver": driver, "summary": headline(replays, driver), "replays": [
        {"golden": one.path, "folder": one.name, "verdict": one.verdict, "words": one.words, "seconds": one.seconds,
         "differences": one.outcome.differences if one.outcome else []} for one in replays]}


def as_junit(replays: Sequence[Replayed], driver: str) -> str:
    """JUnit XML, UTF-8 when encoded: a test case for each log."""
    root = ElementTree.Element("testsuites", {"name": _SUITE})
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": _SUITE, "tests": str(len(replays)), "skipped": "0",
        "failures": str(sum(one.verdict == "different" for one in replays)),
        "errors": str(sum(one.outcome is None for one in replays)), "time": "%.3f" % sum(o.seconds for o in replays)})
    for one in replays:
        case = ElementTree.SubElement(suite, "testcase", {"classname": _SUITE, "name": one.name,
                                                          "time": "%.3f" % one.seconds})
        if one.outcome is None:
            ElementTree.SubElement(case, "error", {"message": one.reason, "type": "not replayed"})
        elif not one.outcome.same:
            failure = ElementTree.SubElement(case, "failure", {"message": one.outcome.headline, "type": "different"})
            failure.text = one.outcome.summary
    ElementTree.SubElement(suite, "system-out").text = headline(replays, driver)
    text = ElementTree.tostring(root, encoding="unicode")
    return '<?xml version="1.0" encoding="UTF-8"?>\n%s\n' % _NOT_XML.sub("?", text)


def _row(one: Replayed) -> str:
    name = escape(one.name)
    if one.outcome is not None and "report.html" in one.outcome.files:
        name = '<a href="%s/report.html">%s</a>' % (name, name)
    style = {"same": "same", "different": "different"}.get(one.verdict, "not-compared")
    more = "<br>".join(escape(words) for words in (one.outcome.differences[:6] if one.outcome else []))
    return ('<tr><td class="outcome %s">%s</td><th scope="row">%s</th><td>%s%s</td><td class="number">%.1f</td></tr>'
            % (style, one.verdict, name, escape(one.words), "<br>" + more if more else "", one.seconds))


def as_page(replays: Sequence[Replayed], driver: str, seconds: float) -> str:
    """The page, to be written as UTF-8 beside the folders of the logs.

    Args:
        replays: All of them.
        driver: What was judged.
        seconds: Wall time of all, s.
    """
    is_good = all(one.verdict == "same" for one in replays)
    order: List[Replayed] = sorted(replays, key=lambda one: (one.verdict == "same", one.name))
    title = "the driver does what all golden logs show" if is_good else "%d of %d golden logs do not happen again" % (
        sum(one.verdict != "same" for one in replays), len(replays))
    facts = [("driver", driver), ("golden logs", "%d, %.0f s of replays in %.0f s" % (
        len(replays), sum(one.seconds for one in replays), seconds))]
    return page(title, (
        '<main><header class="verdict %s"><h1>%s</h1><p>%s</p></header><div class="card">%s</div>'
        '<section id="logs"><h2>Golden logs</h2><div class="card"><div class="scroll"><table><thead><tr>'
        '<th scope="col">Outcome</th><th scope="col">Golden log and report</th><th scope="col">Seen</th>'
        '<th scope="col">s</th></tr></thead><tbody>%s</tbody></table></div></div></section></main>'
        % ("same" if is_good else "different", escape(title), escape(headline(replays, driver)), definitions(facts),
           "".join(map(_row, order)))))
