"""The result of a comparison as JUnit XML: a test case for each check."""
import re
from xml.etree import ElementTree

from ..verdict import Comparison, Outcome
from .text import check_line, headline

_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def _clean(text: str) -> str:
    """Characters that XML cannot hold become question marks."""
    return _NOT_XML.sub("?", text)


def as_junit(comparison: Comparison, suite: str = "jaka_bag.compare") -> str:
    """JUnit XML, UTF-8 when encoded."""
    counts = {outcome: sum(check.outcome is outcome for check in comparison.checks) for outcome in Outcome}
    root = ElementTree.Element("testsuites", {"name": suite})
    element = ElementTree.SubElement(root, "testsuite", {
        "name": suite, "tests": str(len(comparison.checks)), "failures": str(counts[Outcome.DIFFERENT]),
        "errors": "0", "skipped": str(counts[Outcome.NOT_COMPARED]), "time": "0"})
    for check in comparison.checks:
        name = " ".join(part for part in (check.field, check.aspect.value) if part)
        case = ElementTree.SubElement(element, "testcase", {
            "classname": _clean("%s.%s" % (suite, check.topic.strip("/").replace("/", ".") or "all")),
            "name": _clean(name), "time": "0"})
        if check.outcome is Outcome.DIFFERENT:
            failure = ElementTree.SubElement(case, "failure", {"message": _clean(check.detail),
                                                               "type": check.aspect.value})
            failure.text = _clean(check_line(check))
        elif check.outcome is Outcome.NOT_COMPARED:
            ElementTree.SubElement(case, "skipped", {"message": _clean(check.detail)})
    ElementTree.SubElement(element, "system-out").text = _clean(headline(comparison))
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
