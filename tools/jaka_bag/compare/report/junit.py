"""JUnit XML: one comparison, with a test case for each check, or other results with cases."""
import re
from typing import NamedTuple, Sequence
from xml.etree import ElementTree

from ..verdict import Comparison, Outcome
from .text import check_line, headline

SUITE = "jaka_bag.compare"
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Case(NamedTuple):
    """A test case: ``outcome`` is ``failure``, ``error``, ``skipped``, or empty where it passed; ``time`` is in s."""

    classname: str
    name: str
    outcome: str = ""
    message: str = ""
    kind: str = ""
    text: str = ""
    time: str = "0"


def junit(suite_name: str, cases: Sequence[Case], output: str, time: str = "0") -> str:
    """Return a test suite as JUnit XML, UTF-8 when encoded; characters that XML cannot hold become question marks."""
    root = ElementTree.Element("testsuites", {"name": suite_name})
    counts = {name: str(sum(case.outcome == outcome for case in cases)) for name, outcome in (
        ("failures", "failure"), ("errors", "error"), ("skipped", "skipped"))}
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": suite_name, "tests": str(len(cases)), **counts, "time": time})
    for case in cases:
        element = ElementTree.SubElement(suite, "testcase", {
            "classname": "%s%s" % (suite_name, case.classname), "name": case.name, "time": case.time})
        if case.outcome:
            told = {"message": case.message, **({"type": case.kind} if case.kind else {})}
            ElementTree.SubElement(element, case.outcome, told).text = case.text or None
    ElementTree.SubElement(suite, "system-out").text = output
    text = ElementTree.tostring(root, encoding="unicode")
    return '<?xml version="1.0" encoding="UTF-8"?>\n%s\n' % _NOT_XML.sub("?", text)


def as_junit(comparison: Comparison) -> str:
    """Return a comparison as JUnit XML."""
    cases = []
    for check in comparison.checks:
        case = Case("." + (check.topic.strip("/").replace("/", ".") or "all"),
                    " ".join(part for part in (check.field, check.aspect.value) if part))
        if check.outcome is Outcome.DIFFERENT:
            case = case._replace(outcome="failure", message=check.detail, kind=check.aspect.value,
                                 text=check_line(check))
        elif check.outcome is Outcome.NOT_COMPARED:
            case = case._replace(outcome="skipped", message=check.detail)
        cases.append(case)
    return junit(SUITE, cases, headline(comparison))
