"""Many runs against one golden log as JUnit XML: a test case for each run, and for each joint that may drift."""
import re
from typing import List, Tuple
from xml.etree import ElementTree

from jaka_bag.compare.report.text import check_line

from .history import History
from .outcome import DIFFERENT, NOT_COMPARED, UNKNOWN, RunOutcome, as_check
from .summary import drift_title, drift_words

_SUITE = "jaka_bag.runs"
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def _case(suite: ElementTree.Element, run: RunOutcome) -> None:
    case = ElementTree.SubElement(suite, "testcase", {
        "classname": "%s.%s" % (_SUITE, run.cell or "all"), "name": run.path, "time": "0"})
    if run.verdict == DIFFERENT:
        failure = ElementTree.SubElement(case, "failure", {"message": run.reason, "type": run.verdict})
        failure.text = "\n".join(check_line(as_check(check)) for check in run.checks if check.outcome == DIFFERENT)
    elif run.verdict == NOT_COMPARED:
        ElementTree.SubElement(case, "error", {"message": run.reason, "type": run.verdict})
    elif run.verdict == UNKNOWN:
        ElementTree.SubElement(case, "skipped", {"message": run.reason})


def as_junit(history: History) -> str:
    """JUnit XML, UTF-8 when encoded; a drift is told and fails nothing."""
    counts: List[Tuple[str, int]] = [("tests", len(history.runs)), ("failures", history.count(DIFFERENT)),
                                     ("errors", history.count(NOT_COMPARED)), ("skipped", history.count(UNKNOWN))]
    root = ElementTree.Element("testsuites", {"name": _SUITE})
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": _SUITE, "time": "0", **{name: str(number) for name, number in counts}})
    for run in history.runs:
        _case(suite, run)
    lines = [history.headline] + ["%s %s" % (drift_title(series), drift_words(series, history.runs_of(series.cell)))
                                  for series in history.drifts]
    ElementTree.SubElement(suite, "system-out").text = "\n".join(lines)
    text = ElementTree.tostring(root, encoding="unicode")
    return '<?xml version="1.0" encoding="UTF-8"?>\n%s\n' % _NOT_XML.sub("?", text)
