"""The promises of docs/safety.yaml: what each rests on, and the parts of docs/safety.md that are made from them.

A promise has rules of the simulation and planted defects that these rules find. What no simulation of the core can
judge is behaviour, with tests of real processes and the reason. Run as a command, this writes the parts into the page:

    build/venv/bin/python3 test/custody/promises.py
"""
import re
import sys
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Tuple

import yaml

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(folder) for folder in (HERE, HERE / "rules", HERE.parent / "support", HERE.parents[1])]

import defects  # noqa: E402
from verdict import RULES  # noqa: E402

from jaka_ros_driver.probe.statements import STATEMENTS  # noqa: E402

PAGE = HERE.parents[1] / "docs" / "safety.md"
DATA = HERE.parents[1] / "docs" / "safety.yaml"
WIDTH = 118
STATEMENTS_LINK = "[statements](controller-protocol.md#15-statements-that-a-probe-checks)"
_OF_A_CONTROLLER = re.compile(
    r"\b(?:a|the|each) (?:real )?controller (?:that |would |may |does|takes |rounds |carries )|a real one obeys",
    re.IGNORECASE)
"""Words with which a row tells what a controller does, which no test of this project can know of a real one."""


class Entry(NamedTuple):
    """One promise, or one kind of behaviour that is tested and not promised.

    Attributes:
        number: P1, P2, .. for promises, B1, B2, .. for behaviour; the page's headings begin with it.
        id: Its name in the data, by which the short promises cite it.
        title: The whole of it in one line.
        promise: What the title leaves open; may be empty.
        how: The mechanisms, a sentence or more each.
        measured: Figures; may be empty.
        limits: What it does not cover.
        assumes: Ids of the statements of docs/controller-protocol.md section 15 on which it rests.
        assumes_also: What else it rests on that a controller does, of which there is no statement; may be empty.
        tests: Names of the tests that show it.
        tests_note: What a reader must know of these tests; may be empty.
        rules: Names in verdict.RULES; empty for behaviour.
        defects: Names in defects.DEFECTS: cores that break the promise; one of its rules must find each.
        live: Those of ``tests`` that judge what the rules cannot; empty where the rules judge all of it.
        why: What the rules cannot judge; of behaviour, why no rule can.
    """

    number: str
    id: str
    title: str
    promise: str
    how: Tuple[str, ...]
    measured: str
    limits: Tuple[str, ...]
    assumes: Tuple[str, ...]
    assumes_also: str
    tests: Tuple[str, ...]
    tests_note: str
    rules: Tuple[str, ...]
    defects: Tuple[str, ...]
    live: Tuple[str, ...]
    why: str

    @property
    def heading(self) -> str:
        """The page's heading of the entry."""
        return "%s. %s" % (self.number, self.title)

    @property
    def anchor(self) -> str:
        """The link to that heading, as GitHub makes it."""
        return re.sub(r"[^\w\- ]", "", self.heading.lower()).replace(" ", "-")


KEYS = {"id", "title", "promise", "how", "measured", "limits", "assumes", "assumes_also", "tests", "tests_note"}


def _entry(number: str, data: Dict[str, Any], more: Tuple[str, ...]) -> Entry:
    """Read one entry; raise ValueError where a key is unknown."""
    unknown = set(data) - KEYS - set(more)
    if unknown:
        raise ValueError("docs/safety.yaml, %s: unknown %s" % (data.get("id"), sorted(unknown)))
    how = data["how"]
    judged_live = data.get("judged_live", {"tests": (), "what": data.get("no_rule", "")})
    return Entry(
        number, data["id"], data["title"], data.get("promise", ""), (how,) if isinstance(how, str) else tuple(how),
        data.get("measured", ""), tuple(data.get("limits", ())), tuple(data.get("assumes", ())),
        data.get("assumes_also", ""), tuple(data["tests"]), data.get("tests_note", ""),
        tuple(data.get("rules", ())), tuple(data.get("defects", ())), tuple(judged_live["tests"]), judged_live["what"])


_DATA = yaml.safe_load(DATA.read_text(encoding="utf-8"))
PROMISES: Tuple[Entry, ...] = tuple(_entry("P%d" % number, data, ("rules", "defects", "judged_live"))
                                    for number, data in enumerate(_DATA["promises"], 1))
BEHAVIOUR: Tuple[Entry, ...] = tuple(_entry("B%d" % number, data, ("no_rule",))
                                     for number, data in enumerate(_DATA["behaviour"], 1))
IN_SHORT: Tuple[Tuple[str, Tuple[str, ...]], ...] = tuple(
    (line["text"], tuple(line["rests_on"])) for line in _DATA["in_short"])
"""The lines of the page's first screen, and the ids of the promises on which each rests."""
BESIDES: Dict[str, str] = {
    "a": "custody itself, on which the promises rest",
    "k": "a driver that is always in custody keeps every other promise",
    "l": "a driver that is never ready keeps every other promise",
    "state": "custody itself, seen from within",
    "contract": "a core that fails keeps no promise",
}
"""Rules that serve no single promise, each with the reason why it exists."""


def rule_of(name: str) -> str:
    """Return the rule by which a planted defect must be found; raise StopIteration for an unknown defect."""
    return next(defect.rule for defect in defects.DEFECTS if defect.make.__name__ == name)


def unnamed_assumption(entry: Entry) -> str:
    """Return words by which an entry rests on what a controller does without naming a statement; "" for none."""
    found = _OF_A_CONTROLLER.search(" ".join([entry.promise, *entry.how, *entry.limits]))
    return found.group() if found and not entry.assumes and not entry.assumes_also else ""


def faults_of(promise: Entry) -> List[str]:
    """Return what keeps an entry from being promised: without a rule and a planted defect that it finds, nothing is."""
    faults = ["no rule %s" % rule for rule in promise.rules if rule not in RULES]
    known = {defect.make.__name__ for defect in defects.DEFECTS}
    faults += ["no planted defect %s" % name for name in promise.defects if name not in known]
    faults += ["%s is found by rule %s, which is not among its rules" % (name, rule_of(name))
               for name in promise.defects if name in known and rule_of(name) not in promise.rules]
    if not promise.rules:
        faults.append("no rule of the simulation")
    if not promise.defects:
        faults.append("no planted defect")
    return faults


# ---- the parts of the page ----

def _wrapped(text: str, first: str = "", rest: str = "") -> str:
    """Fill a paragraph; no line is broken inside a link or a name."""
    lines, line = [], first
    for word in re.findall(r"\[[^\]]*\]\([^)]*\)\S*|`[^`]*`\S*|\S+", text):
        longer = line + word if line in (first, rest) else "%s %s" % (line, word)
        if len(longer) > WIDTH and line not in (first, rest):
            lines.append(line)
            longer = rest + word
        line = longer
    return "\n".join([*lines, line])


def _item(name: str, text: str) -> str:
    return _wrapped("*%s:* %s" % (name, text), "- ", "  ")


def _items(name: str, texts: Tuple[str, ...]) -> List[str]:
    if len(texts) == 1:
        return [_item(name, texts[0])]
    return ["- *%s:*" % name, *(_wrapped(text, "  - ", "    ") for text in texts)] if texts else []


def _names(names: Tuple[str, ...]) -> str:
    return ", ".join("`%s`" % name for name in names)


def in_short() -> str:
    """Return the short promises, each with links to those that it rests on."""
    entries = {entry.id: entry for entry in PROMISES + BEHAVIOUR}
    lines = []
    for number, (text, ids) in enumerate(IN_SHORT, 1):
        links = ", ".join("[%s](#%s)" % (entries[one].number, entries[one].anchor) for one in ids)
        lines.append(_wrapped("%s (%s)" % (text, links), "%d. " % number, "   "))
    return "\n".join(lines)


def shown(entry: Entry) -> str:
    """Return an entry's section of the appendix."""
    parts = [_wrapped(entry.promise) + "\n"] if entry.promise else []
    parts += _items("How", entry.how)
    if entry.measured:
        parts.append(_item("Measured", entry.measured))
    parts += _items("Not covered", entry.limits)
    if entry.assumes:
        parts.append(_item("Rests on the controller", "%s; %s that `jaka_probe` checks%s" % (
            "; ".join("%s, %s" % (number, STATEMENTS[number].says) for number in entry.assumes), STATEMENTS_LINK,
            ". " + entry.assumes_also if entry.assumes_also else ".")))
    elif entry.assumes_also:
        parts.append(_item("Rests on the controller", entry.assumes_also))
    if entry.rules:
        parts.append(_item("Rules of the simulation", "; ".join(RULES[name] for name in entry.rules)
                           + ". *Planted defects:* " + _names(entry.defects) + "."))
        if entry.live:
            parts.append(_item("Judged by live tests", "%s (%s)." % (entry.why, _names(entry.live))))
    else:
        parts.append(_item("No rule of the simulation", entry.why + "."))
    parts.append(_item("Tests", _names(entry.tests) + "." + (" " + entry.tests_note if entry.tests_note else "")))
    return "#### %s\n\n%s\n" % (entry.heading, "\n".join(parts))


PARTS = {
    "in short": in_short,
    "promises": lambda: "\n".join(map(shown, PROMISES)),
    "behaviour": lambda: "\n".join(map(shown, BEHAVIOUR)),
}


def written(text: str) -> str:
    """Return the page with its made parts made anew; raise ValueError where a part has no place."""
    for name, make in PARTS.items():
        begin, end = "<!-- %s -->\n" % name, "<!-- end of %s -->" % name
        before, found, rest = text.partition(begin)
        _, ends, after = rest.partition(end)
        if not (found and ends):
            raise ValueError("the page has no place for: " + name)
        text = before + begin + "\n" + make().strip() + "\n\n" + end + after
    return text


def main() -> None:
    """Write the made parts into the page."""
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
