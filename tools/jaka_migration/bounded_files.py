"""Readers of YAML and XML files that nobody vouches for: bounded in size and depth, with the line of everything.

Nothing of a file is run or fetched: YAML stays a graph of nodes, in which aliases are never multiplied, and XML that
declares entities or a document type is refused.
"""
import math
import os
import re
import stat
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple, Union
from xml.parsers import expat

import yaml

LARGEST_XML, LARGEST_YAML = 4_000_000, 500_000
"""Most bytes of a file: descriptions with long comments have some 100 kB, a configuration some 10 kB."""
DEEPEST = 60
"""Most levels of a file; a launch file, and a MoveIt configuration, has fewer than ten."""
MOST_PARTS = 50_000
"""Most events of a YAML file, and elements of an XML file."""
MOST_ITEMS = 200
"""Most elements of a list that are looked at: an alias may stand for the same long list many times."""
_DEGREES = re.compile(r"(deg|rad)\(\s*([-+.\deE]+)\s*\)")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class Unreadable(Exception):
    """A file that cannot be read; the reason, without the file's name.

    Attributes:
        line: The line of the fault, from 1; None where it has none.
    """

    def __init__(self, reason: str, line: Optional[int] = None) -> None:
        super().__init__(reason)
        self.line = line


def read_bytes(path: str, largest: int) -> bytes:
    """Return the content of a regular file of at most ``largest`` bytes.

    Raises:
        Unreadable: There is no such file, it is no regular file, too large, or may not be read.
    """
    try:
        # without waiting: a named pipe would block for ever
        with open(path, "rb", opener=lambda name, flags: _regular(os.open(name, flags | os.O_NONBLOCK))) as file:
            content = file.read(largest + 1)
    except (OSError, ValueError) as error:
        raise Unreadable("cannot be opened: %s" % (getattr(error, "strerror", None) or error)) from error
    if len(content) > largest:
        raise Unreadable("is larger than %d bytes" % largest)
    return content


def _regular(number: int) -> int:
    """Return the descriptor of a regular file; close any other and raise Unreadable."""
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise Unreadable("is no regular file")
    return number


# ---- YAML ----

class YamlNode:
    """A node of a YAML file with its line.

    Attributes:
        line: The line where it begins, from 1.
    """

    def __init__(self, node: "yaml.Node") -> None:
        self._node = node
        self.line = int(node.start_mark.line) + 1

    @property
    def is_mapping(self) -> bool:
        """True where it has keys."""
        return isinstance(self._node, yaml.MappingNode)

    @property
    def is_sequence(self) -> bool:
        """True where it is a list."""
        return isinstance(self._node, yaml.SequenceNode)

    def keys(self) -> List[Tuple[str, int]]:
        """Return the keys of a mapping that are plain texts, each with its line; empty for any other node."""
        if not isinstance(self._node, yaml.MappingNode):
            return []
        return [(key.value, key.start_mark.line + 1) for key, _ in self._node.value if isinstance(key, yaml.ScalarNode)]

    def get(self, name: str) -> Optional["YamlNode"]:
        """Return the value of a key, the last where it is there twice, or that of a mapping that is merged by ``<<``.

        None where there is no such key, or this is no mapping.
        """
        merged = None
        if not isinstance(self._node, yaml.MappingNode):
            return None
        for key, value in reversed(self._node.value):
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value == name:
                return YamlNode(value)
            if key.value == "<<" and isinstance(value, yaml.MappingNode) and merged is None:
                merged = next((YamlNode(under) for of, under in value.value
                               if isinstance(of, yaml.ScalarNode) and of.value == name), None)
        return merged

    def items(self) -> List["YamlNode"]:
        """Return the first ``MOST_ITEMS`` elements of a list; empty for any other node."""
        return list(map(YamlNode, self._node.value[:MOST_ITEMS])) if isinstance(self._node, yaml.SequenceNode) else []

    @property
    def text(self) -> Optional[str]:
        """The text of a scalar as it is written; None for any other node."""
        return self._node.value if isinstance(self._node, yaml.ScalarNode) else None

    @property
    def truth(self) -> Optional[bool]:
        """The value of a boolean; None for any other node."""
        word = (self.text or "").lower()
        if self._node.tag != "tag:yaml.org,2002:bool":
            return None
        return word in ("yes", "true", "on")

    @property
    def number(self) -> Optional[float]:
        """The value of a finite number, and of rosparam's ``!degrees``, ``deg(..)`` and ``rad(..)``, in rad then."""
        text = self.text
        if text is None:
            return None
        found = _DEGREES.fullmatch(text.strip())
        factor = 1.0
        if self._node.tag == "!degrees" or found and found.group(1) == "deg":
            factor = math.pi / 180.0
        return number_of(found.group(2) if found else text, factor)


def number_of(text: Optional[str], factor: float = 1.0) -> Optional[float]:
    """Return a text as a finite number times a factor; None where it is none."""
    try:
        value = float(text) * factor if text is not None and len(text) < 100 and "_" not in text else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def read_yaml(path: str) -> Optional[YamlNode]:
    """Return the first document of a YAML file; None where it is empty.

    Raises:
        Unreadable: The file cannot be read, is no YAML, or is too deep or too large.
    """
    content = read_bytes(path, LARGEST_YAML)
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise Unreadable("is no UTF-8: byte %d" % error.start, content.count(b"\n", 0, error.start) + 1) from error
    try:
        _bound_yaml(content)
        node = yaml.compose(content, Loader=_LOADER)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or getattr(error, "reason", None) or error
        if "nesting depth" in str(reason):  # some versions of libyaml have a limit of their own
            reason = "it is deeper than %d levels" % DEEPEST
        raise Unreadable("is no YAML: %s" % reason, mark.line + 1 if mark is not None else None) from error
    return None if node is None else YamlNode(node)


def _bound_yaml(content: bytes) -> None:
    """Raise Unreadable where the file is too deep or has too many parts; composing it takes one call a level."""
    depth = 0
    for number, event in enumerate(yaml.parse(content, Loader=_LOADER)):
        line = event.start_mark.line + 1 if event.start_mark is not None else None
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            raise Unreadable("is deeper than %d levels" % DEEPEST, line)
        if number > MOST_PARTS:
            raise Unreadable("has more than %d parts" % MOST_PARTS, line)


# ---- XML ----

class Element(NamedTuple):
    """An element of an XML file.

    Attributes:
        tag: Its name.
        attributes: Their values by name.
        line: Where it begins, from 1.
        children: The elements in it.
        texts: The pieces of text directly in it.
    """

    tag: str
    attributes: Dict[str, str]
    line: int
    children: List["Element"]
    texts: List[str]

    def get(self, name: str) -> str:
        """Return an attribute without spaces around it; empty where it is not there."""
        return self.attributes.get(name, "").strip()

    def all(self, tag: str) -> List["Element"]:
        """Return the children of this name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Optional["Element"]:
        """Return the first child of this name; None where there is none."""
        return next(iter(self.all(tag)), None)

    def walk(self) -> Iterator["Element"]:
        """Return this element and all below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def text(self) -> str:
        """The text directly in it, without spaces around it."""
        return "".join(self.texts).strip()


def read_xml(path: str) -> Element:
    """Return the root element of an XML file.

    Raises:
        Unreadable: The file cannot be read, is no XML, declares a document type or entities, or is too deep or large.
    """
    content = read_bytes(path, LARGEST_XML)
    parser = expat.ParserCreate()
    top = Element("", {}, 0, [], [])
    open_elements = [top]
    count = 0

    def start(tag: str, attributes: Dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_elements) > DEEPEST:
            raise Unreadable("is deeper than %d levels" % DEEPEST, parser.CurrentLineNumber)
        if count > MOST_PARTS:
            raise Unreadable("has more than %d elements" % MOST_PARTS, parser.CurrentLineNumber)
        element = Element(tag, attributes, parser.CurrentLineNumber, [], [])
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def characters(text: str) -> None:
        open_elements[-1].texts.append(text)

    def refuse(*_: Union[str, int, None]) -> None:
        raise Unreadable("declares a document type, which no such file needs; entities are not read",
                         parser.CurrentLineNumber)

    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise Unreadable("is no XML: %s" % expat.ErrorString(error.code), error.lineno) from error
    except (LookupError, ValueError) as error:  # an encoding that Python lacks, or one that expat cannot take
        raise Unreadable("is no XML: %s" % error, parser.CurrentLineNumber) from error
    return top.children[0]
