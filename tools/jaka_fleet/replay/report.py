"""All replays of a driver as a page, as JUnit XML, as text and as plain data."""
from html import escape
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

from jaka_bag.compare.report.html import definitions, page
from jaka_bag.compare.report.junit import Case, junit

from .replay_task import ReplayOutcome

_SUITE = "jaka_bag.replay"


class Replayed(NamedTuple):
    """One golden log.

    Attributes:
        name: Name of its folder among the reports.
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
        """The verdict in a word or two."""
        return "not replayed" if self.outcome is None else "same" if self.outcome.same else "different"

    @property
    def words(self) -> str:
        """The outcome's headline, or the reason why there is none."""
        return self.reason if self.outcome is None else self.outcome.headline


def headline(replays: Sequence[Replayed], driver: str) -> str:
    """Count the replays by verdict, for the headline."""
    counts = {verdict: sum(one.verdict == verdict for one in replays)
              for verdict in ("same", "different", "not replayed")}
    return "%s, %d golden logs: %s" % (driver, len(replays), ", ".join(
        "%d %s" % (count, verdict) for verdict, count in counts.items()))


def as_text(replays: Sequence[Replayed], driver: str) -> str:
    """Return a line for each log, and the headline."""
    lines = ["%-13s %s: %s" % (one.verdict.upper(), one.path, one.words) for one in replays]
    return "\n".join([*lines, headline(replays, driver)])


def as_data(replays: Sequence[Replayed], driver: str) -> Dict[str, Any]:
    """Return the replays as plain data, for JSON."""
    return {"format": 1, "driver": driver, "summary": headline(replays, driver), "replays": [
        {"golden": one.path, "folder": one.name, "verdict": one.verdict, "words": one.words, "seconds": one.seconds,
         "differences": one.outcome.differences if one.outcome else []} for one in replays]}


def as_junit(replays: Sequence[Replayed], driver: str) -> str:
    """Return JUnit XML, with a test case for each log."""
    cases = []
    for one in replays:
        case = Case("", one.name, time="%.3f" % one.seconds)
        if one.outcome is None:
            case = case._replace(outcome="error", message=one.reason, kind="not replayed")
        elif not one.outcome.same:
            case = case._replace(outcome="failure", message=one.outcome.headline, kind="different",
                                 text=one.outcome.summary)
        cases.append(case)
    return junit(_SUITE, cases, headline(replays, driver), "%.3f" % sum(one.seconds for one in replays))


def _row(one: Replayed) -> str:
    name = escape(one.name)
    if one.outcome is not None and "report.html" in one.outcome.files:
        name = '<a href="%s/report.html">%s</a>' % (name, name)
    style = {"same": "same", "different": "different"}.get(one.verdict, "not-compared")
    more = "<br>".join(escape(words) for words in (one.outcome.differences[:6] if one.outcome else []))
    return ('<tr><td class="outcome %s">%s</td><th scope="row">%s</th><td>%s%s</td><td class="number">%.1f</td></tr>'
            % (style, one.verdict, name, escape(one.words), "<br>" + more if more else "", one.seconds))


def as_page(replays: Sequence[Replayed], driver: str, seconds: float) -> str:
    """Return the page, to be written as UTF-8 beside the folders of the logs.

    Args:
        replays: All of them.
        driver: Driver that was judged.
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
