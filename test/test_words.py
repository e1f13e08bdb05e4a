"""The form of docstrings, by room, words and class names with one meaning each, reasons of tuned constants.

As a command (``python3 test/test_words.py ROOM...``) it prints the counts by room, and each finding in the rooms that
are named.
"""
import ast
import re
import sys
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("jaka_ros_driver", "tools", "test", "docs", "cmake")
BANNED = frozenset(
    "As At By How It Of That What When Where Whether Which Who Whose Why With "
    "After Before Behind Between For From If In On So To Within Without Its Their They This These Those "
    "Another Both Neither Not Same Also".split())
"""First words that lean on the name above the docstring."""
VERBS = frozenset(
    "accept account acknowledge acquire act add adopt advance align allow announce answer append apply ask assert "
    "assign attach audit await begin believe bind block bound brake bring build bundle call cancel carry cause "
    "change check choose clamp classify clear close collect combine command compare compile complete compress "
    "compute configure confirm connect consume continue convert copy correct count create cut deal decide decode "
    "decompress decrease defer define delay delete deliver deny derive describe detach detect determine disable "
    "discard disconnect display dispute divide do download drain draw drive drop duplicate emit empty enable "
    "encode end energise enforce engage enlarge ensure enter escape estimate evaluate exchange execute exit "
    "expand expect export extend extract fail fetch fill filter find finish fit flush fold follow forbid force "
    "forget format forward free freeze gather generate get give go grant group guard guide hand handle have hit "
    "hold identify ignore import include increase index infer inject insert inspect install integrate interpolate "
    "interrupt invert iterate jog join judge jump keep kill label launch learn leave let limit link list listen load "
    "locate lock log look lose lower make map mark match measure merge mirror move multiply name narrow normalise "
    "note notice notify observe offer omit open operate order pair parse pass pause perform permit pick place "
    "plan play plot point poll pop post power predict prefix prepare press prevent print probe process produce "
    "project protect prove provide publish pull push put query queue quote raise rank reach read rebuild receive "
    "recognise reconnect record recover reduce refer refine refuse register reject release remember remove rename "
    "render repeat replace replay reply report represent request require reset resolve respond restart restore "
    "resume retry return reverse revert rewrite ring rotate round run sample save scale scan schedule search see "
    "select send separate serve set shed shift shorten show shut sign simulate skip sleep slow smooth solve sort "
    "spawn split stamp start state stay step stop store stream strip submit subscribe subtract suggest sum "
    "summarise supply suppress swap switch synchronise take tear terminate test tighten tilt time touch trace "
    "track train transform translate travel treat trim truncate try turn undo unload unlock unpack unregister "
    "update use validate verify visit wait wake walk warn watch wire withdraw wrap write yield zero zip".split())
"""Words with which a function's docstring may begin; one that is missing here, and is a verb, is added."""
PLURALS = frozenset(
    "answers calls changes checks commands counts fields filters frames jogs joints limits links logs moves names "
    "offers orders paths places plans points processes ranks reads records replies reports requests samples "
    "scans searches shifts signals signs starts states stamps steps stops stores streams tests times traces turns "
    "waits writes".split())
"""Third persons of verbs that are plural nouns as well, so a class may begin with them."""
_OBJECT = re.compile(r"\s+(the|a|an|all|each|every|it|its|them|these|this)\b")
"""Words behind which a word that is verb and noun was the verb."""


TWO_MEANINGS: Dict[str, str] = {
    "ConnectionLost": "the errors of the driver and of the log tools, which import nothing of each other",
    "ProtocolError": "the same",
    "MotionState": "the enumeration of RobotMsg, which the log tools have for themselves, for the same reason",
}
"""Public names of types of the driver that the tools use, too, each with the reason; at most four."""


NOT_THE_CONTROLLERS = re.compile(
    r"\b[Pp]rograms?\s+`*(?:jaka_\w+|migrate_cell|check_moveit_config)\b"
    r"|\b(?:[Aa]nother|[Oo]ther|[Kk]illed|[Tt]his|[Yy]our|[Pp]ublic|[Pp]ython|desktop|two|cell's(?:\s+own)?|user's)"
    r"\s+programs?\b"
    r"|\b[Pp]rograms\s+(?:such|written|built|of\s+(?:a\s+cell|others))\b|\bfor\s+programs\b|\bprograms?\s+of\s+yours\b")
"""Words in which "program" is not the controller's: said of a command, a process, other software, the cell's nodes."""


class Finding(NamedTuple):
    """A docstring in the wrong form: its room, the place in its file, the reason."""

    room: str
    place: str
    reason: str


class Docstring(NamedTuple):
    """One docstring of a file; ``kind`` is module, class, function, property or constant."""

    kind: str
    name: str
    line: int
    text: str


def third_persons() -> Iterator[str]:
    """Return the third person singular of each verb."""
    for verb in VERBS:
        if verb.endswith("y") and verb[-2] not in "aeou":
            yield verb[:-1] + "ies"
        elif re.search(r"(s|x|z|ch|sh|o)$", verb):
            yield verb + "es"
        else:
            yield verb + "s"


THIRD_PERSONS = frozenset(third_persons()) | {"has", "is", "are", "does"}


def is_property(node: ast.AST) -> bool:
    """Return whether a function is a property, by its decorators."""
    names = [item.attr if isinstance(item, ast.Attribute) else getattr(item, "id", "")
             for item in getattr(node, "decorator_list", [])]
    return any(name in ("property", "cached_property") for name in names)


def text_of(node: ast.AST) -> Optional[str]:
    """Return the text of a statement that is nothing but a string."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return node.value.value
    return None


def docstrings(tree: ast.Module) -> Iterator[Docstring]:
    """Return every docstring of a file, with those below constants and attributes."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            text = ast.get_docstring(node)
            if text is not None:
                kind = "module" if isinstance(node, ast.Module) else "class" if isinstance(
                    node, ast.ClassDef) else "property" if is_property(node) else "function"
                yield Docstring(kind, getattr(node, "name", "module"), node.body[0].lineno, text)
            for before, after in zip(node.body, node.body[1:]):
                text = text_of(after)
                if text is not None and isinstance(before, (ast.Assign, ast.AnnAssign)):
                    yield Docstring("constant", ast.dump(before), after.lineno, text)


def fault(docstring: Docstring) -> str:
    """Return the reason why a docstring is in the wrong form; empty for a right one."""
    first, _, _ = docstring.text.strip().partition("\n\n")
    word = (re.match(r"[\w'-]*", first) or [""])[0]
    if not first:
        return "is empty"
    if word in BANNED:
        return "begins with %s" % word
    if not re.match(r"[A-Z0-9`\"'~]", first):
        return "begins with a small letter or a unit"
    if not first.rstrip("\"`'").endswith((".", ":", "?")):
        return "does not end with a period"
    if docstring.kind == "function":
        return "" if word.lower() in VERBS else "does not begin with a verb in the imperative: %s" % word
    if word.lower() in THIRD_PERSONS - PLURALS or (
            word.lower() in VERBS | THIRD_PERSONS and _OBJECT.match(first, len(word))):
        return "begins with a verb: %s" % word
    return ""


def room_of(path: Path) -> str:
    """Return the folder by which a file is counted: two levels of the driver and of tools/, one elsewhere."""
    parts = path.relative_to(ROOT).parts[:-1]
    return "/".join(parts[:2] if parts[0] in ("jaka_ros_driver", "tools") else parts[:1])


@lru_cache(maxsize=None)
def findings() -> Tuple[Finding, ...]:
    """Return each docstring of the repository in the wrong form."""
    found = []
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            for docstring in docstrings(ast.parse(path.read_text(encoding="utf-8"))):
                reason = fault(docstring)
                if reason:
                    found.append(Finding(room_of(path), "%s:%d" % (path.relative_to(ROOT), docstring.line), reason))
    return tuple(found)


def type_names(tree: ast.Module) -> Iterator[Tuple[str, int]]:
    """Return each public name of a class, and of a type that a module assigns to a name, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node.lineno
    for statement in tree.body:
        targets = statement.targets if isinstance(statement, ast.Assign) else [
            statement.target] if isinstance(statement, ast.AnnAssign) else []
        for target in targets:
            if isinstance(target, ast.Name) and re.fullmatch(r"(?:[A-Z][a-z0-9]+)+", target.id):
                yield target.id, statement.lineno


def class_names() -> Dict[str, List[str]]:
    """Return the places in which each public name of a type is defined, in the driver and the tools."""
    places: Dict[str, List[str]] = {}
    for folder in ("jaka_ros_driver", "tools"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            for name, line in type_names(ast.parse(path.read_text(encoding="utf-8"))):
                places.setdefault(name, []).append("%s:%d" % (path.relative_to(ROOT), line))
    return places


def own_files(*kinds: str) -> Iterator[Path]:
    """Return the files of these kinds, as ``.py``, that are the project's own, and not another's or made by it."""
    for folder in (*FOLDERS, "launch"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in kinds and "vendor" not in path.parts and path != Path(__file__).resolve():
                yield path
    yield from (path for path in sorted(ROOT.glob("*")) if path.suffix in kinds and path.name != "CHANGELOG.rst")


def test_a_program_is_the_controllers():
    found = []
    for path in own_files(".py", ".md", ".js", ".html", ".launch", ".test", ".yaml", ".in", ".toml", ".txt"):
        text = path.read_text(encoding="utf-8")
        found += ["%s:%d %r" % (path.relative_to(ROOT), text.count("\n", 0, match.start()) + 1, match.group())
                  for match in NOT_THE_CONTROLLERS.finditer(text)]
    assert not found, "\n".join(found)


def test_a_program_that_is_not_the_controllers_is_seen():
    for text in ("The program ``jaka_bag``.", "the program migrate_cell", "Another\nprogram answers there.",
                 "what a killed program left", "Programs such as rqt", "End the cell's own program",
                 "JSON, for programs"):
        assert NOT_THE_CONTROLLERS.search(text), text
    for text in ("Load the named program.", "a program of the controller", "another's program, the pendant's program",
                 "`program/load` and the programs that a log loads"):
        assert not NOT_THE_CONTROLLERS.search(text), text


def test_docstrings_have_their_form():
    wrong = ["%s %s" % (finding.place, finding.reason) for finding in findings()]
    assert not wrong, "\n".join(wrong)


JS_COMMENT = re.compile(r"/\*\*[\s*]*([\w'-]+)")
"""A doc comment of JavaScript, with its first word; one that begins with a tag has none."""


def wrong_comments(text: str) -> Iterator[Tuple[int, str]]:
    """Return line and first word of each doc comment of a JavaScript file that leans on the name below it."""
    for match in JS_COMMENT.finditer(text):
        if match.group(1) in BANNED:
            yield text.count("\n", 0, match.start()) + 1, match.group(1)


def test_doc_comments_of_javascript_have_their_form():
    wrong = ["%s:%d begins with %s" % (path.relative_to(ROOT), line, word) for path in own_files(".js")
             for line, word in wrong_comments(path.read_text(encoding="utf-8"))]
    assert not wrong, "\n".join(wrong)


def test_wrong_doc_comments_of_javascript_are_seen():
    assert list(wrong_comments("/** What it knows. */\n/**\n * Of the page.\n */\n/** @type {What} */\n"
                               "/** The names. */\n/* With care */\n")) == [(1, "What"), (2, "Of")]


def test_wrong_docstrings_are_seen():
    tree = ast.parse('''"""With one page."""
PERIOD_S = 0.5
"""s; how often."""


class Reader:
    """Reads the port."""

    limit: int
    """Of the port."""

    @property
    def scheme(self):
        """Of its address."""

    def name(self):
        """The name."""

    def run(self):
        """Runs until the end."""

    def stop(self):
        """Stop at once"""

    def right(self):
        """Return the name."""
''')
    assert {each.text: fault(each) for each in docstrings(tree)} == {
        "With one page.": "begins with With", "s; how often.": "begins with a small letter or a unit",
        "Reads the port.": "begins with a verb: Reads", "Of the port.": "begins with Of",
        "Of its address.": "begins with Of",
        "The name.": "does not begin with a verb in the imperative: The",
        "Runs until the end.": "does not begin with a verb in the imperative: Runs",
        "Stop at once": "does not end with a period", "Return the name.": ""}


def test_a_class_name_stands_for_one_thing():
    shared = {name: places for name, places in class_names().items() if len(places) > 1}
    new = ["%s: %s" % (name, ", ".join(places)) for name, places in sorted(shared.items()) if name not in TWO_MEANINGS]
    assert not new, "\n".join(new)
    stale = set(TWO_MEANINGS) - set(shared)
    assert not stale, "these names have one meaning now, take them out of the list: %s" % ", ".join(sorted(stale))
    assert len(TWO_MEANINGS) <= 4


def test_names_of_types_are_seen_however_a_module_makes_them():
    tree = ast.parse("class Reply:\n    class Part: ...\nclass _Own: ...\nEvent = Union[int, str]\n"
                     "Item: TypeAlias = 'int'\n_Tell = int\nLIMIT = 5\nfound = 3\ndef f():\n    Local = int\n")
    assert list(type_names(tree)) == [("Reply", 1), ("Part", 2), ("Event", 4), ("Item", 5)]


TUNED = re.compile(r"(?<!_PER)_(S|MS|MM|M|RAD|HZ|LIMIT|TOLERANCE)$|(MOST|LONGEST|LEAST|MAX)_|PERIOD|TIMEOUT|PATIENCE")
"""Names of constants that somebody has tuned: periods, limits, tolerances."""


def is_number(node: ast.AST) -> bool:
    """Return whether an expression is made of numbers alone: one, several, or computed from some."""
    values = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant)]
    return bool(values) and all(type(value) in (int, float) for value in values) and not any(
        isinstance(part, (ast.Dict, ast.Set, ast.Lambda, ast.Subscript)) for part in ast.walk(node))


def without_reason(text: str) -> Iterator[Tuple[str, int]]:
    """Return name and line of each tuned constant of a file with no text below, and no comment above it or behind."""
    lines = text.splitlines()
    for owner in ast.walk(ast.parse(text)):
        body = owner.body if isinstance(owner, (ast.Module, ast.ClassDef)) else []
        for node, after in zip(body, [*body[1:], ast.Pass()]):
            if not isinstance(node, (ast.Assign, ast.AnnAssign)) or node.value is None or not is_number(node.value):
                continue
            names = [part.id for target in getattr(node, "targets", None) or [node.target]
                     for part in ast.walk(target) if isinstance(part, ast.Name)]
            has_comment = "#" in lines[node.lineno - 1] or lines[node.lineno - 2].lstrip().startswith("#")
            if text_of(after) is None and not has_comment:
                yield from ((name, node.lineno) for name in names if name.isupper() and TUNED.search(name))


def test_tuned_constants_have_their_reason():
    bare = ["%s:%d %s" % (path.relative_to(ROOT), line, name) for path in own_files(".py")
            if path.relative_to(ROOT).parts[0] in ("jaka_ros_driver", "tools")
            for name, line in without_reason(path.read_text(encoding="utf-8"))]
    assert not bare, "\n".join(bare)


def test_a_tuned_constant_without_a_reason_is_seen():
    bare = '_TURN_S = 0.02\nMOST_PARTS, _FEW = 64, 4\nclass Feed:\n    _PERIOD: float = -1.5 * LIMIT\n'
    assert list(without_reason(bare)) == [("_TURN_S", 1), ("MOST_PARTS", 2), ("_PERIOD", 4)]
    assert not list(without_reason(
        '_TURN_S = 0.02\n"""Period, s."""\n# as the kernel has it\n_WAIT_S = 5\nA_LIMIT = 3  # of the wire\n'
        'NS_PER_S = 10\n_MOST = 3\nA_LIMIT = OTHER\nTEXT_LIMIT = "5"\nperiod = 5\ndef f():\n    WAIT_S = 3\n'))


def main(rooms: List[str]) -> None:
    """Print the counts by room, and the findings in ``rooms``."""
    found = list(findings())
    for finding in found:
        if finding.room in rooms:
            print("%s %s" % (finding.place, finding.reason))
    counts: Dict[str, int] = Counter(finding.room for finding in found)
    for room, count in sorted(counts.items()):
        print("%5d %s" % (count, room))


if __name__ == "__main__":
    main(sys.argv[1:])
