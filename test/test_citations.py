"""The citations in the code: every cited page exists, and so does the section."""
import re

import pytest
from import_graph import ROOT

CODE = sorted(path for folder in ("jaka_ros_driver", "test", "tools", "cmake") for path in (ROOT / folder).rglob("*.py")
              if path.name not in ("test_citations.py", "test_documents.py"))
NUMBER = r"\d+(?:\.\d+)*"
PAGE = re.compile(r"docs/[\w-]+\.md")
CITED = re.compile(r"(docs/[\w-]+\.md)(?:,? sections? (%s(?:(?:, | to | and )%s)*)|, \"([^\"]+)\")" % (NUMBER, NUMBER))
LOOSE = re.compile(r"\b(?:controller protocol|SDK client|interface document)\b", re.IGNORECASE)


def running_text(text):
    """Return the text as one line, so that a citation may be broken over lines of a docstring or comment."""
    return re.sub(r"\s*\n\s*(?:#\s)?\s*", " ", text)


def headings(page):
    """Return the headings of a page as they stand there, without their marks, and their numbers."""
    found = re.findall(r"^#+ +(.+?) *$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    numbers = {match.group(1) for match in (re.match(r"(%s)\.? " % NUMBER, heading) for heading in found) if match}
    return set(found), numbers


def wrong_citations(text):
    for page in sorted(set(PAGE.findall(text))):
        if not (ROOT / page).is_file():
            yield "%s does not exist" % page
    for page, numbers, heading in CITED.findall(text):
        if (ROOT / page).is_file():
            known, known_numbers = headings(page)
            for number in re.findall(NUMBER, numbers):
                if number not in known_numbers:
                    yield "%s has no section %s" % (page, number)
            if heading and heading not in known:
                yield "%s has no heading %r" % (page, heading)
    for loose in LOOSE.findall(text):
        yield "%r is cited without its page" % loose


def test_every_citation_leads_to_a_page_and_a_section_of_it():
    wrong = ["%s: %s" % (path.relative_to(ROOT), what) for path in CODE
             for what in wrong_citations(running_text(path.read_text(encoding="utf-8")))]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("text, what", [
    ("see docs/nowhere.md", "docs/nowhere.md does not exist"),
    ("docs/controller-protocol.md section 5.99", "has no section 5.99"),
    ("docs/controller-protocol.md sections 5.1, 5.98", "has no section 5.98"),
    ('docs/controller-protocol.md, "Channels of old"', "has no heading"),
    ("controller\n    protocol 5.1", "cited without its page"),
])
def test_a_wrong_citation_is_found(text, what):
    (found,) = wrong_citations(running_text(text))
    assert what in found


def test_right_citations_are_right():
    assert not list(wrong_citations(running_text(
        'docs/controller-protocol.md, "1. Channels", docs/controller-protocol.md section\n # 5.6.5; docs/interface.md'
    )))
