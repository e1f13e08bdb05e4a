"""The result of a comparison as JUnit XML: a test case for each check."""
import re
from xml.etree import ElementTree

from ..verdict import Comparison, Outcome
from .text import check_line, headline

_SUITE = "jaka_bag.compare"
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def as_junit(comparison: Comparison) -> str:
    """JUnit XML, UTF-8 when encoded; characters that XML cannot hold become question marks."""
    counts = {outcome: sum(check.outcome is outcome for check in comparison.checks) for outcome in Outcome}
    root = ElementTree.Element("testsuites", {"name": _SUITE})
    suite = ElementTree.SubElement(root, "testsuite", {
        "name": _SUITE, "tests": str(len(comparison.checks)), "failures": str(counts[Outcome.DIFFERENT]),
        "errors": "0", "skipped": str(counts[Outcome.NOT_COMPARED]), "time": "0"})
    for check in comparison.checks:
        case = ElementTree.SubElement(suite, "testcase", {
            "classname": "%s.%s" % (_SUITE, check.topic.strip("/").replace("/", ".") or "all"),
            "name": " ".join(part for part in (check.field, check.aspect.value) if part), "time": "0"})
        if check.outcome is Outcome.DIFFERENT:
            failure = ElementTree.SubElement(case, "failure", {"message": check.detail, "type": check.aspect.value})
            failure.text = check_line(check)
        elif check.outcome is Outcome.NOT_COMPARED:
            ElementTree.SubElement(case, "skipped", {"message": check.detail})
    ElementTree.SubElement(suite, "system-out").text = headline(comparison)
    text = ElementTree.tostring(root, encoding="unicode")
    return '<?xml version="1.0" encoding="UTF-8"?>\n%s\n' % _NOT_XML.sub("?", text)
